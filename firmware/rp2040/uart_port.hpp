// SPDX-License-Identifier: BSD-3-Clause
// The serial line: bytes with the time at which they came, in both directions by interrupts.
#pragma once

#include "board_clock.hpp"
#include "wake_flag.hpp"

namespace versavis::rp2040 {

/// Buffers between the core, in the main loop, and the UART's interrupt.
class UartPort final : public firmware::ImuUart {
 public:
    UartPort(BoardClock& clock, WakeFlag& wake_flag) : clock_(clock), wake_flag_(wake_flag) {}

    void set_up();

    void set_baud(std::uint32_t baud) override;
    void invert_transmitter(bool inverted) override;
    void write(const std::uint8_t* data, std::size_t size) override;
    std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override;

    /// From its interrupt.
    void moved();

 private:
    /// Bytes that came without a pause.
    struct Chunk {
        Nanoseconds at;  ///< of the last one
        std::uint32_t end;
    };
    static constexpr unsigned room = 512;
    static constexpr unsigned chunks = 128;
    static constexpr unsigned outgoing_room = 256;

    void send();

    BoardClock& clock_;
    WakeFlag& wake_flag_;
    std::uint32_t baud_ = 0;
    volatile std::uint32_t arrived_ = 0;  ///< bytes, modulo 2^32
    volatile std::uint32_t read_ = 0;
    volatile std::uint32_t ended_ = 0;  ///< chunks
    volatile std::uint32_t begun_ = 0;  ///< of them, read to the end
    volatile std::uint32_t written_ = 0;
    volatile std::uint32_t sent_ = 0;
    Chunk chunk_[chunks] = {};
    std::uint8_t incoming_[room] = {};
    std::uint8_t outgoing_[outgoing_room] = {};
};

}  // namespace versavis::rp2040
