// SPDX-License-Identifier: BSD-3-Clause
// Regular pulses at an output: sync to other boards, or the ticks of an IMU.
#pragma once

#include "grid.hpp"
#include "grid_clock.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

class PulseTrain {
 public:
    PulseTrain(unsigned output, OutputQueue& outputs) : output_(output), outputs_(outputs) {}

    /// A pulse at each point of `grid`, which is in the time of `clock`.
    void begin(const Grid& grid, const GridClock& clock, Nanoseconds width, Nanoseconds now) {
        grid_ = grid;
        clock_ = &clock;
        width_ = width;
        skip(now);
    }
    void stop() { clock_ = nullptr; }

    void poll(Nanoseconds now) {
        if (clock_ == nullptr) return;
        // A late pulse would be taken for one on time: it is left out.
        if (at() < now) skip(now);
        while (at() - OutputQueue::horizon <= now && outputs_.has_room()) {
            outputs_.pulse(at(), output_, true, width_);
            grid_.advance();
        }
    }

    Nanoseconds next_wake() const {
        return clock_ == nullptr ? never : at() - OutputQueue::horizon;
    }

 private:
    Nanoseconds at() const { return clock_->board_time(grid_.next()); }
    void skip(Nanoseconds now) {
        grid_.skip_before(clock_->grid_time(now));
        while (at() < now + OutputQueue::horizon) grid_.advance();
    }

    unsigned output_;
    OutputQueue& outputs_;
    Grid grid_;
    const GridClock* clock_ = nullptr;
    Nanoseconds width_ = 0;
};

}  // namespace versavis::firmware
