// SPDX-License-Identifier: BSD-3-Clause
// Regular pulses at an output: sync to other boards, or the ticks of an IMU.
#pragma once

#include "grid.hpp"
#include "grid_clock.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

class PulseTrain {
 public:
    explicit PulseTrain(OutputQueue& outputs) : outputs_(outputs) {}

    /// A pulse at each point of `grid`, which is in the time of `clock`, at `output`.
    void begin(unsigned output, const Grid& grid, const GridClock& clock, Nanoseconds width,
               Nanoseconds now) {
        output_ = output;
        grid_ = grid;
        clock_ = &clock;
        width_ = width;
        skip(now);
    }
    void stop() { clock_ = nullptr; }
    /// The clock changed.
    void moved() {
        if (clock_ != nullptr) at_ = clock_->board_time(grid_.next());
    }

    /// Before each commit of the outputs: pulses are decided further ahead than words are
    /// committed.
    void poll(Nanoseconds now) {
        if (clock_ == nullptr || at_ > now + furthest) return;
        // A late pulse would be taken for one on time: it is left out.
        if (at_ < now + soonest) skip(now);
        while (at_ <= now + furthest && outputs_.has_room(output_)) {
            outputs_.pulse(at_, output_, true, width_);
            grid_.advance();
            moved();
        }
    }

    Nanoseconds next_wake() const { return clock_ == nullptr ? never : at_ - wake_ahead; }

 private:
    /// A pulse is decided this long before it leaves, at most: many at once where they are fast. At
    /// half, words for other outputs overtake it; at twice, the room of the output does not hold
    /// it.
    static constexpr Nanoseconds furthest = 1'200'000;
    static_assert(furthest > OutputQueue::horizon);
    /// At half, a slow poll leaves pulses out; at twice, fast trains take more polls.
    static constexpr Nanoseconds wake_ahead = 700'000;
    /// What is decided later than that may leave late. At half, a port with a horizon of its own
    /// makes it late; at twice, pulses are left out that would be on time.
    static constexpr Nanoseconds soonest = 300'000;

    void skip(Nanoseconds now) {
        grid_.skip_before(clock_->grid_time(now + soonest));
        moved();
        while (at_ < now + soonest) {
            grid_.advance();
            moved();
        }
    }

    OutputQueue& outputs_;
    unsigned output_ = 0;
    Grid grid_;
    const GridClock* clock_ = nullptr;
    Nanoseconds width_ = 0;
    Nanoseconds at_ = 0;  ///< of the next pulse
};

}  // namespace versavis::firmware
