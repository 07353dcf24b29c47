// SPDX-License-Identifier: BSD-3-Clause
// Reads an ADIS16448 in bursts that hardware starts on a grid; facts from its data sheet (burst mode with
// CRC).
#pragma once

#include "grid.hpp"
#include "hal.hpp"
#include "versavis/wire/messages.hpp"

namespace versavis::firmware {

namespace adis16448 {
inline constexpr std::uint8_t burst_command = 0x3E;
inline constexpr std::size_t burst_words =
    13;  ///< status, 3 gyro, 3 accel, 3 magnetic, pressure, temperature, CRC
inline constexpr std::size_t burst_bytes = 2 + 2 * burst_words;

/// CRC over words 1..11 of a burst (angular rate to temperature), low byte of each word first.
std::uint16_t burst_crc(const std::uint8_t* words);
}  // namespace adis16448

class ImuSampler {
 public:
    explicit ImuSampler(ImuBus& bus) : bus_(bus) {}

    void configure(const wire::ImuConfiguration& configuration, Nanoseconds now);

    /// Sets the next burst when it is due, and takes one that has completed. True: `sample` holds a new
    /// sample.
    bool poll(Nanoseconds now, wire::ImuSample& sample);

    Nanoseconds next_wake() const;
    std::uint32_t errors() const { return errors_; }

 private:
    void parse(const Transfer& transfer, wire::ImuSample& sample);

    ImuBus& bus_;
    Grid grid_;
    bool enabled_ = false;
    bool overrun_ = false;
    std::uint32_t number_ = 0;
    std::uint32_t errors_ = 0;
};

}  // namespace versavis::firmware
