// SPDX-License-Identifier: BSD-3-Clause
// Equally spaced instants at any rate from micro-hertz, without accumulated drift.
#pragma once

#include <cstdint>

#include "hal.hpp"

namespace versavis::firmware {

/// Tick k lies at origin + floor(k * 10^15 / rate_uhz) ns: the remainder of the period is carried
/// (Bresenham).
class Grid {
 public:
    Grid() = default;
    Grid(Nanoseconds origin, std::int64_t rate_uhz)
        : next_(origin),
          rate_uhz_(rate_uhz),
          whole_(ns_uhz / rate_uhz),
          remainder_(ns_uhz % rate_uhz) {}

    Nanoseconds next() const { return next_; }
    std::uint64_t tick() const { return tick_; }
    Nanoseconds period() const { return whole_; }

    void advance() {
        ++tick_;
        next_ += whole_;
        carry_ += remainder_;
        if (carry_ >= rate_uhz_) {
            carry_ -= rate_uhz_;
            ++next_;
        }
    }

    /// advance(), `ticks` times.
    void advance_by(std::int64_t ticks) {
        for (; ticks > most_at_once; ticks -= most_at_once) advance_by(most_at_once);
        const std::int64_t carried = carry_ + ticks * remainder_;
        const std::int64_t whole = carried / rate_uhz_;
        tick_ += static_cast<std::uint64_t>(ticks);
        next_ += ticks * whole_ + whole;
        carry_ = carried - whole * rate_uhz_;
    }

    /// Moves to a tick within one period before `at`, in few steps, however long ago the origin
    /// was.
    void skip_before(Nanoseconds at) {
        while (at - next_ > whole_) advance_by((at - next_) / (whole_ + 1));
    }

 private:
    static constexpr std::int64_t ns_uhz = 1'000'000'000'000'000;
    /// So that it times a remainder of up to 10^10 stays within 64 bits. At half, a step is made
    /// twice; ten times as much would overflow.
    static constexpr std::int64_t most_at_once = 400'000'000;

    Nanoseconds next_ = 0;
    std::uint64_t tick_ = 0;
    std::int64_t rate_uhz_ = 1;
    Nanoseconds whole_ = 0;
    std::int64_t remainder_ = 0;
    std::int64_t carry_ = 0;
};

}  // namespace versavis::firmware
