// SPDX-License-Identifier: BSD-3-Clause
// Instants and durations in integer nanoseconds, one type per clock, so that clocks cannot be mixed
// by accident.
#pragma once

#include <cstdint>
#include <limits>

#include "versavis/error.hpp"
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

/// The epoch of what belongs to none, as a status document.
inline constexpr std::uint32_t no_epoch = 0xFFFFFFFFU;

/// Why there is no span between two instants: they are of two epochs, or of none.
struct OtherEpoch {};

/// An instant of the output time, with what it belongs to. Instants of two epochs do not compare:
/// in between, the output clock or the board's clock was set, or the service restarted. So nothing
/// compares them as they are; since() looks first.
struct EpochTime {
    std::uint64_t life = 0;  ///< of the service; 0: older than ABI 1.5
    std::int64_t ns = 0;
    std::uint32_t epoch = no_epoch;

    constexpr bool compares_with(const EpochTime& other) const {
        return epoch != no_epoch && epoch == other.epoch && life == other.life;
    }

    /// The span from `earlier` to here, negative if that is later; one that no Duration can hold
    /// is the longest there is. No optional, which would compare with a Duration: "nothing" is less
    /// than all of them.
    Expected<Duration, OtherEpoch> since(const EpochTime& earlier) const {
        if (!compares_with(earlier)) return Unexpected<OtherEpoch>({});
        std::int64_t span = 0;
        if (!__builtin_sub_overflow(ns, earlier.ns, &span)) return Duration{span};
        return Duration{ns < earlier.ns ? std::numeric_limits<std::int64_t>::min()
                                        : std::numeric_limits<std::int64_t>::max()};
    }

    /// True when it was published before: an earlier epoch precedes a later one, whatever their
    /// times say. Both are of one life.
    constexpr bool precedes(const EpochTime& other) const {
        return epoch != other.epoch ? epoch < other.epoch : ns < other.ns;
    }

    /// Without what it belongs to: for one who knows that all of them are of one epoch.
    constexpr OutputTime output() const { return {ns}; }

    friend bool operator==(const EpochTime&, const EpochTime&) = delete;
    friend bool operator!=(const EpochTime&, const EpochTime&) = delete;
    friend bool operator<(const EpochTime&, const EpochTime&) = delete;
    friend bool operator>(const EpochTime&, const EpochTime&) = delete;
    friend bool operator<=(const EpochTime&, const EpochTime&) = delete;
    friend bool operator>=(const EpochTime&, const EpochTime&) = delete;
    friend Duration operator-(const EpochTime&, const EpochTime&) = delete;
};

/// Middle of an interval, without overflow; rounds towards `begin`.
template <class Clock>
constexpr Time<Clock> middle(Time<Clock> begin, Time<Clock> end) {
    return begin + (end - begin) / 2;
}

/// The host clock now.
VERSAVIS_API HostTime host_now();

}  // namespace versavis
