// SPDX-License-Identifier: BSD-3-Clause
// Bytes between the core and the bulk endpoints of USB.
#pragma once

#include "board_clock.hpp"
#include "wake_flag.hpp"

namespace versavis::rp2040 {

/// Buffers between the core, in the main loop, and UsbDevice, in its interrupt.
class UsbLink final : public firmware::ByteLink {
 public:
    static constexpr std::size_t packet_size = firmware::link_packet_size;

    UsbLink(BoardClock& clock, WakeFlag& wake_flag) : clock_(clock), wake_flag_(wake_flag) {}

    // The core's side.
    std::size_t free_space() override;
    void write(const std::uint8_t* data, std::size_t size) override;
    std::size_t read(std::uint8_t* data, Nanoseconds& received) override;
    void watch_departure() override;
    bool take_departure(Nanoseconds& at) override;

    // The endpoints' side, from the interrupt that works for USB.

    /// The next packet for the host; 0: none waits.
    std::size_t fill(std::uint8_t* packet);
    /// The host has acknowledged it, as an interrupt has seen at this time.
    void sent(std::size_t size, std::uint32_t at_us);
    bool can_receive() const { return received_ - read_ < packets; }
    void receive(const std::uint8_t* data, std::size_t size, std::uint32_t at_us);
    bool has_more() { return sending_ = written_ != taken_; }
    /// A new host, or none: what waits is for nobody. So many bytes are still to be acknowledged.
    void forget(std::uint32_t in_flight);

 private:
    struct Packet {
        std::uint8_t bytes[packet_size];
        std::size_t size;
        Nanoseconds at;
    };
    static constexpr unsigned packets = 4;
    /// For the host. If lower, a poll sends less than a start has to say; if higher, the core
    /// writes for longer in one poll.
    static constexpr std::uint32_t capacity = 1024;

    BoardClock& clock_;
    WakeFlag& wake_flag_;
    volatile std::uint32_t written_ = 0;  ///< bytes, modulo 2^32
    volatile std::uint32_t taken_ = 0;    ///< into packets
    volatile std::uint32_t sent_count_ = 0;
    volatile std::uint32_t watched_ = 0;
    volatile bool sending_ = false;  ///< a packet is on its way: the next follows without asking
    volatile bool watching_ = false;
    volatile bool departed_ = false;
    volatile bool was_full_ = false;
    Nanoseconds departed_at_ = 0;
    volatile std::uint32_t received_ = 0;  ///< packets
    volatile std::uint32_t read_ = 0;
    Packet incoming_[packets];
    alignas(std::uint32_t) std::uint8_t outgoing_[capacity];
};

}  // namespace versavis::rp2040
