// SPDX-License-Identifier: BSD-3-Clause
// A VN-100 as seen from the other end of its UART: text commands in, text and binary packets out.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "inertial.hpp"

namespace versavis::devices {

class Vn100Device {
 public:
    explicit Vn100Device(World world) : world_(std::move(world)) {}

    struct Burst {
        Nanoseconds complete;  ///< when its last byte has been sent
        std::vector<std::uint8_t> bytes;
    };

    /// Takes bytes sent at `baud`; returns answers.
    std::vector<Burst> receive(Nanoseconds at, std::uint32_t baud,
                               std::span<const std::uint8_t> bytes);

    /// When it takes its next sample, at 800 Hz; none: it is mute or paused.
    std::optional<Nanoseconds> next_sample(Nanoseconds after) const;
    /// True: the sync output rises with the sample that begins at `at`.
    bool pulses(Nanoseconds at) const;
    /// True: that sample is sent.
    bool sends(Nanoseconds at) const;

    /// The packet of the sample that began at `at`.
    Burst packet(Nanoseconds at);

    std::uint32_t baud() const { return baud_; }
    /// Text that it sends on its own, as after its power-up.
    Burst chatter(Nanoseconds at) const;

    /// From a sample to the first byte of its packet.
    void delay(Nanoseconds delay) { delay_ = delay; }
    void mute(bool muted) { muted_ = muted; }
    /// It takes no new data after `at`, though it goes on sending; never: it does again.
    void freeze(Nanoseconds at) { frozen_at_ = at; }
    void corrupt(unsigned packets) { corrupted_ = packets; }

 private:
    std::optional<std::string> execute(const std::string& command);
    Burst send(Nanoseconds at, std::vector<std::uint8_t> bytes, std::uint32_t baud) const;

    World world_;
    std::string line_;
    std::uint32_t baud_ = 115'200;
    bool paused_ = false;
    unsigned text_output_ = 14;
    unsigned divider_ = 0;  ///< 0: no binary output
    unsigned sync_mode_ = 6;
    unsigned sync_skip_ = 0;
    Nanoseconds delay_ = 400'000;
    bool muted_ = false;
    Nanoseconds frozen_at_ = firmware::never;
    unsigned corrupted_ = 0;
};

}  // namespace versavis::devices
