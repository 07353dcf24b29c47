// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

#include "wire/limits.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds billion = 1'000'000'000;

/// One part in this many.
constexpr std::int64_t largest_pace = 1'000'000 / wire::limits::largest_sync_pace_ppm;

/// One part in this many (50 ppm), of two crystals that warm up. If lower, false pulses pass more
/// easily; if higher, a gap in the pulses loses the sender sooner.
constexpr std::int64_t largest_change = 20'000;

/// In periods, before the pace is known. If lower, a lost first pulse is not forgiven; if higher,
/// the tolerance is that much wider.
constexpr Nanoseconds longest_first_gap = 4;

constexpr std::int64_t sync_slew_ppb = wire::limits::sync_slew_ppm * 1'000;

/// In periods. If lower, a few lost pulses are reported as the loss of the sender; if higher, it is
/// reported late.
constexpr Nanoseconds longest_silence = 10;

/// In parts of 10^9: by how much more than `nominal` the sender's `since` took on this board.
std::int64_t pace_ppb(Nanoseconds since, Nanoseconds nominal) {
    return (since - nominal) * 1'000'000 / (nominal / 1000);
}

/// Whole seconds, to the nearest.
Nanoseconds nearest_second(Nanoseconds at) {
    const Nanoseconds half_later = at + billion / 2;
    const Nanoseconds past = half_later % billion;
    return half_later - (past < 0 ? past + billion : past);
}

}  // namespace

GridLine::GridLine(Nanoseconds board, Nanoseconds grid, std::int64_t pace_ppb)
    : board_(board), grid_(grid), pace_ppb_(pace_ppb) {
    const std::int64_t scaled = pace_ppb * (std::int64_t{1} << 40);
    pace_ = (scaled + (scaled < 0 ? -billion : billion) / 2) / billion;
}

Nanoseconds GridLine::board_time(Nanoseconds grid_time) const {
    const Nanoseconds since = grid_time - grid_;
    return board_ + since + gained(since);
}

Nanoseconds GridLine::grid_time(Nanoseconds board_time) const {
    const Nanoseconds since = board_time - board_;
    if (pace_ == 0) return grid_ + since;
    const Nanoseconds margin =
        ((since < 0 ? -since : since) >> 27) + 4;  // more than the cube of the pace
    return grid_ + since - gained(since - gained(since)) - margin;
}

Nanoseconds GridLine::gained(Nanoseconds since) const {
    if (pace_ == 0) return 0;
    const Nanoseconds low = (since & 0xFFFFFFFF) * pace_;
    const Nanoseconds high = (since >> 32) * pace_;
    return (high + (low >> 32) + 128) >> 8;
}

void GridClock::begin(Nanoseconds origin, Nanoseconds sync_period, Nanoseconds since) {
    *this = {};
    pace_known_ = since != 0;
    line_ = GridLine(origin, 0, pace_known_ ? pace_ppb(since, sync_period) : 0);
    period_ = sync_period;
    newest_pulse_ = origin;
}

Nanoseconds GridClock::board_time(Nanoseconds grid_time) const {
    return (grid_time < bend_ ? approach_ : line_).board_time(grid_time);
}

Nanoseconds GridClock::grid_time(Nanoseconds board_time) const {
    const bool approaches = bend_ != no_bend && board_time < line_.board_time(bend_);
    return (approaches ? approach_ : line_).grid_time(board_time);
}

GridClock::SyncPulse GridClock::sync_pulse(Nanoseconds at, bool running) {
    if (period_ == 0) return {};
    const Nanoseconds since = at - line_.board();
    const Nanoseconds periods = (since + period_ / 2) / period_;
    const Nanoseconds nominal = periods * period_;
    // Pulses may be missing. Once the pace is known, it predicts the next one after any gap.
    const Nanoseconds off = at - line_.board_time(line_.grid() + nominal);
    Nanoseconds tolerance = (periods > longest_first_gap ? period_ : nominal) / largest_pace;
    if (pace_known_) tolerance = period_ / largest_change;
    if (periods <= 0 || off > tolerance || -off > tolerance) return take_rival(at, off, running);
    const GridLine line(at, line_.grid() + nominal, pace_ppb(since, nominal));
    const bool approaches = bend_ != no_bend && grid_time(at) < bend_;
    if (approaches)
        steer(line, sync_slew_ppb, at);
    else
        line_ = line;
    pace_known_ = fits_ = true;
    newest_pulse_ = at;
    candidate_.clear();
    return {Sync::followed, off};
}

GridClock::SyncPulse GridClock::take_rival(Nanoseconds at, Nanoseconds off, bool running) {
    if (!candidate_.add(at, period_, largest_pace)) {
        const bool first = fits_;
        fits_ = false;
        return {first ? Sync::lost : Sync::ignored, off};
    }
    // Its pulses lie on the multiples of its period that are nearest, or next: ticks that have been
    // do not come again.
    const std::int64_t pace = pace_ppb(at - candidate_.first(), candidate_.periods() * period_);
    const Nanoseconds later = grid_time(at) + (running ? period_ / 2 : period_ - 1);
    const Nanoseconds past = later % period_;
    const Nanoseconds multiple = later - (past < 0 ? past + period_ : past);
    const Nanoseconds moves = at - board_time(multiple);
    const GridLine line(at, multiple, pace);
    if (running) {
        steer(line, sync_slew_ppb, at);
    } else {
        line_ = line;
        bend_ = no_bend;
    }
    pace_known_ = fits_ = true;
    newest_pulse_ = at;
    candidate_.clear();
    return {Sync::taken, moves};
}

wire::SyncState GridClock::sync_state(Nanoseconds now) const {
    if (period_ == 0) return wire::SyncState::none;
    const bool silent = now - newest_pulse_ > longest_silence * period_;
    const bool approaches = bend_ != no_bend && grid_time(now) < bend_;
    return silent || !fits_ || approaches ? wire::SyncState::lost : wire::SyncState::followed;
}

/// From `now` on the grid goes to `target`, at no more than `max_slew_ppb` beyond its pace. What is
/// already under way keeps its time: the new line starts where the old one is now.
void GridClock::steer(const GridLine& target, std::int64_t max_slew_ppb, Nanoseconds now) {
    const Nanoseconds grid = grid_time(now);
    const Nanoseconds board = board_time(grid);
    const Nanoseconds offset = target.board_time(grid) - board;
    const std::int64_t slew = offset < 0 ? -max_slew_ppb : max_slew_ppb;
    approach_ = GridLine(board, grid, target.pace_ppb() + slew);
    line_ = target;
    bend_ = grid + offset * billion / slew;
}

void GridClock::align(Nanoseconds second, std::int32_t pace_ppb, std::uint32_t max_slew_ppb,
                      Nanoseconds now) {
    const Nanoseconds grid = grid_time(now);
    const GridLine unmoved(board_time(grid), grid, pace_ppb);
    const Nanoseconds whole = nearest_second(unmoved.grid_time(second));
    steer(GridLine(second, whole, pace_ppb), max_slew_ppb, now);
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
