// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

namespace versavis::firmware {

namespace {

constexpr std::int64_t largest_pace = 2000;  // 1 / 2000: no crystals differ by more than 500 ppm

}  // namespace

bool GridClock::sync_pulse(Nanoseconds at) {
    if (period_ == 0) return false;
    const Nanoseconds since = at - anchor_;
    const Nanoseconds periods = (since + period_ / 2) / period_;
    if (periods <= 0) return periods == 0 && since == 0;
    const Nanoseconds nominal = periods * period_;
    const Nanoseconds off = since - nominal;
    if (off > nominal / largest_pace || -off > nominal / largest_pace) return false;
    anchor_ = at;
    anchor_grid_ += nominal;
    pace_ppb_ = off * 1'000'000 / (nominal / 1000);
    return true;
}

}  // namespace versavis::firmware
