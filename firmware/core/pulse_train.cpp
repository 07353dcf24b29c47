// SPDX-License-Identifier: BSD-3-Clause
#include "pulse_train.hpp"

namespace versavis::firmware {

namespace {

/// A pulse is decided this long before it leaves, at most: many at once where they are fast. If
/// lower, words for other outputs overtake it; if higher, the room of the output does not hold it.
constexpr Nanoseconds furthest = 1'200'000;
static_assert(furthest > OutputQueue::horizon);
/// If lower, a slow poll leaves pulses out; if higher, fast trains take more polls.
constexpr Nanoseconds wake_ahead = 700'000;
/// What is decided later than that may leave late. If lower, a port with a horizon of its own makes
/// it late; if higher, pulses are left out that would be on time.
constexpr Nanoseconds soonest = 400'000;

}  // namespace

void PulseTrain::begin(unsigned output, const Grid& grid, const GridClock& clock, Nanoseconds width,
                       Nanoseconds now) {
    output_ = output;
    grid_ = grid;
    clock_ = &clock;
    width_ = width;
    skip(now);
}

void PulseTrain::poll(Nanoseconds now) {
    if (clock_ == nullptr || at_ > now + furthest) return;
    // A late pulse would look like one on time, so it is left out.
    if (at_ < now + soonest) skip(now);
    while (at_ <= now + furthest && outputs_.has_room(output_)) {
        outputs_.pulse(at_, output_, true, width_);
        grid_.advance();
        moved();
    }
}

Nanoseconds PulseTrain::next_wake() const { return clock_ == nullptr ? never : at_ - wake_ahead; }

void PulseTrain::skip(Nanoseconds now) {
    grid_.skip_before(clock_->grid_time(now + soonest));
    moved();
    while (at_ < now + soonest) {
        grid_.advance();
        moved();
    }
}

}  // namespace versavis::firmware
