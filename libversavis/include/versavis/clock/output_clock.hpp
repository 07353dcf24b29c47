// SPDX-License-Identifier: BSD-3-Clause
// Host time to the clock that the user chose for published stamps.
#pragma once

#include <cstdint>
#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

enum class OutputClockKind { realtime, tai, monotonic_raw };
const char* to_string(OutputClockKind kind);

/// Reads both clocks in a sandwich, so that a preempted read cannot bend the translation.
class OutputClock {
 public:
    /// Error: TAI was asked for, but the kernel does not know its offset from UTC.
    static Expected<OutputClock> create(OutputClockKind kind);

    /// Output clock minus host clock, now.
    Duration offset();

    /// Steps of the output clock that were seen by offset().
    std::uint32_t steps() const { return steps_; }
    OutputClockKind kind() const { return kind_; }

 private:
    explicit OutputClock(OutputClockKind kind);

    OutputClockKind kind_;
    Duration against_monotonic_;
    std::uint32_t steps_ = 0;
};

}  // namespace versavis::clock
