// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

namespace versavis::firmware {

namespace {

constexpr std::int64_t largest_pace = 2000;  // 1 / 2000: no crystals differ by more than 500 ppm

constexpr std::int64_t largest_change = 20'000;  // 50 ppm: of two crystals that warm up
constexpr Nanoseconds longest_first_gap = 4;     // in periods, before the pace is known

}  // namespace

bool GridClock::sync_pulse(Nanoseconds at) {
    if (period_ == 0) return false;
    const Nanoseconds periods = (at - anchor_ + period_ / 2) / period_;
    if (periods <= 0) return false;
    const Nanoseconds nominal = periods * period_;
    // Pulses may be missing. Once the pace is known, it says when the next one comes, however long that is.
    const Nanoseconds off = at - board_time(anchor_grid_ + nominal);
    Nanoseconds tolerance = (periods > longest_first_gap ? period_ : nominal) / largest_pace;
    if (pace_known_) tolerance = period_ / largest_change;
    if (off > tolerance || -off > tolerance) return false;
    pace_ppb_ = (at - anchor_ - nominal) * 1'000'000 / (nominal / 1000);
    pace_known_ = true;
    anchor_ = at;
    anchor_grid_ += nominal;
    return true;
}

}  // namespace versavis::firmware
