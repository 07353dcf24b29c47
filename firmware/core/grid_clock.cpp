// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds billion = 1'000'000'000;
constexpr std::int64_t largest_pace = 2000;  // 1 / 2000: no crystals differ by more than 500 ppm

constexpr std::int64_t largest_change = 20'000;  // 50 ppm: of two crystals that warm up
constexpr Nanoseconds longest_first_gap = 4;     // in periods, before the pace is known

/// Whole seconds, to the nearest.
Nanoseconds nearest_second(Nanoseconds at) {
    const Nanoseconds half_later = at + billion / 2;
    const Nanoseconds past = half_later % billion;
    return half_later - (past < 0 ? past + billion : past);
}

}  // namespace

GridLine::GridLine(Nanoseconds board, Nanoseconds grid, std::int64_t pace_ppb)
    : board_(board), grid_(grid) {
    const std::int64_t scaled = pace_ppb * (std::int64_t{1} << 40);
    pace_ = (scaled + (scaled < 0 ? -billion : billion) / 2) / billion;
}

bool GridClock::sync_pulse(Nanoseconds at) {
    if (period_ == 0) return false;
    const Nanoseconds since = at - line_.board();
    const Nanoseconds periods = (since + period_ / 2) / period_;
    if (periods <= 0) return false;
    const Nanoseconds nominal = periods * period_;
    // Pulses may be missing. Once the pace is known, it predicts the next one after any gap.
    const Nanoseconds off = at - board_time(line_.grid() + nominal);
    Nanoseconds tolerance = (periods > longest_first_gap ? period_ : nominal) / largest_pace;
    if (pace_known_) tolerance = period_ / largest_change;
    if (off > tolerance || -off > tolerance) return false;
    line_ = GridLine(at, line_.grid() + nominal, (since - nominal) * 1'000'000 / (nominal / 1000));
    pace_known_ = true;
    return true;
}

void GridClock::align(Nanoseconds second, std::int32_t pace_ppb, std::uint32_t max_slew_ppb,
                      Nanoseconds now) {
    // What is already under way keeps its time: the new line starts where the old one is now.
    const Nanoseconds grid = grid_time(now);
    const GridLine unmoved(board_time(grid), grid, pace_ppb);
    const Nanoseconds whole = nearest_second(unmoved.grid_time(second));
    const Nanoseconds offset = second - unmoved.board_time(whole);
    const std::int64_t slew = offset < 0 ? -std::int64_t{max_slew_ppb} : std::int64_t{max_slew_ppb};
    approach_ = GridLine(unmoved.board(), grid, pace_ppb + slew);
    line_ = GridLine(second, whole, pace_ppb);
    bend_ = grid + offset * billion / slew;
    period_ = 0;
}

void GridClock::place(Nanoseconds second, std::int32_t pace_ppb) {
    line_ = GridLine(second, nearest_second(grid_time(second)), pace_ppb);
    bend_ = no_bend;
    period_ = 0;
}

Nanoseconds GridClock::misplaced(Nanoseconds second) const {
    return second - board_time(nearest_second(grid_time(second)));
}

}  // namespace versavis::firmware
