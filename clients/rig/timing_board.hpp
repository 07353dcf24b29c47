// SPDX-License-Identifier: BSD-3-Clause
// A board of ten LEDs that counts pulses where cameras can see it.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>

#include "scenario.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// In a row: one that is always on; four of which one is lit, the next one with each pulse; four
/// that show in binary how often those four have been through; and one more that is always on.
/// Thread-safe.
class TimingBoard {
 public:
    static constexpr std::size_t leds = 10;
    using Row = std::array<double, leds>;

    explicit TimingBoard(const LedScenario& scenario) : scenario_(scenario) {}

    unsigned output() const { return scenario_.output; }

    /// The output that it counts rose. Instants must not go back.
    void pulse(HostTime at);
    /// All pulses up to `until` have been reported.
    void settle(HostTime until);

    /// What share of the exposure each LED was on. Waits, half a second at most, until all pulses
    /// up to the end of the exposure have been reported.
    Row lit(HostTime start, HostTime end);

    /// While so many pulses have been counted.
    Row shown(std::uint64_t count) const;

 private:
    LedScenario scenario_;
    std::mutex mutex_;
    std::condition_variable settled_;
    std::deque<HostTime> pulses_;  ///< the newest
    std::uint64_t forgotten_ = 0;  ///< pulses before those
    HostTime known_until_{INT64_MIN};
};

}  // namespace versavis::rig
