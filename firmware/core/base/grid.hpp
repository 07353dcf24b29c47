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
    Grid(Nanoseconds origin, std::int64_t rate_uhz);

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
    void advance_by(std::int64_t ticks);

    /// Moves to a tick within one period before `at`, in few steps, however long ago the origin
    /// was.
    void skip_before(Nanoseconds at);

 private:
    Nanoseconds next_ = 0;
    std::uint64_t tick_ = 0;
    std::int64_t rate_uhz_ = 1;
    Nanoseconds whole_ = 0;
    std::int64_t remainder_ = 0;
    std::int64_t carry_ = 0;
};

}  // namespace versavis::firmware
