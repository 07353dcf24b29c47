// SPDX-License-Identifier: BSD-3-Clause
// Instants and durations in integer nanoseconds, one type per clock, so that clocks cannot be mixed
// by accident.
#pragma once

#include <cstdint>

#include "versavis/export.hpp"

namespace versavis {

/// A span of time in nanoseconds, the same on every clock.
struct Duration {
    std::int64_t ns = 0;

    constexpr friend bool operator==(Duration a, Duration b) { return a.ns == b.ns; }
    constexpr friend bool operator!=(Duration a, Duration b) { return a.ns != b.ns; }
    constexpr friend bool operator<(Duration a, Duration b) { return a.ns < b.ns; }
    constexpr friend bool operator>(Duration a, Duration b) { return a.ns > b.ns; }
    constexpr friend bool operator<=(Duration a, Duration b) { return a.ns <= b.ns; }
    constexpr friend bool operator>=(Duration a, Duration b) { return a.ns >= b.ns; }
    constexpr friend Duration operator+(Duration a, Duration b) { return {a.ns + b.ns}; }
    constexpr friend Duration operator-(Duration a, Duration b) { return {a.ns - b.ns}; }
    constexpr friend Duration operator-(Duration a) { return {-a.ns}; }
    constexpr friend Duration operator*(Duration a, std::int64_t factor) { return {a.ns * factor}; }
    constexpr friend Duration operator/(Duration a, std::int64_t divisor) {
        return {a.ns / divisor};
    }
};

constexpr Duration nanoseconds(std::int64_t n) { return {n}; }
constexpr Duration microseconds(std::int64_t n) { return {n * 1'000}; }
constexpr Duration milliseconds(std::int64_t n) { return {n * 1'000'000}; }
constexpr Duration seconds(std::int64_t n) { return {n * 1'000'000'000}; }
constexpr Duration absolute(Duration d) { return d.ns < 0 ? -d : d; }

/// An instant on the clock named by Clock, in nanoseconds since that clock's own zero.
template <class Clock>
struct Time {
    std::int64_t ns = 0;

    constexpr friend bool operator==(Time a, Time b) { return a.ns == b.ns; }
    constexpr friend bool operator!=(Time a, Time b) { return a.ns != b.ns; }
    constexpr friend bool operator<(Time a, Time b) { return a.ns < b.ns; }
    constexpr friend bool operator>(Time a, Time b) { return a.ns > b.ns; }
    constexpr friend bool operator<=(Time a, Time b) { return a.ns <= b.ns; }
    constexpr friend bool operator>=(Time a, Time b) { return a.ns >= b.ns; }
    constexpr friend Duration operator-(Time a, Time b) { return {a.ns - b.ns}; }
    constexpr friend Time operator+(Time t, Duration d) { return {t.ns + d.ns}; }
    constexpr friend Time operator-(Time t, Duration d) { return {t.ns - d.ns}; }
};

using BoardTime = Time<struct BoardClockTag>;  ///< the trigger board's clock, since its boot
using HostTime = Time<struct HostClockTag>;    ///< CLOCK_MONOTONIC_RAW of this machine
using OutputTime =
    Time<struct OutputClockTag>;  ///< the clock that the user chose for published stamps
using CameraTime = Time<struct CameraClockTag>;  ///< a camera's own clock

/// Middle of an interval, without overflow; rounds towards `begin`.
template <class Clock>
constexpr Time<Clock> middle(Time<Clock> begin, Time<Clock> end) {
    return begin + (end - begin) / 2;
}

/// The host clock now.
VERSAVIS_API HostTime host_now();

}  // namespace versavis
