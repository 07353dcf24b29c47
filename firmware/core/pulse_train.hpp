// SPDX-License-Identifier: BSD-3-Clause
// Regular pulses at an output: sync to other boards, or the ticks of an IMU.
#pragma once

#include "base/grid.hpp"
#include "grid_clock.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

/// Decides the pulses of one output, one at each point of a grid, a little ahead. Part of Board,
/// called from Board::poll() only.
class PulseTrain {
 public:
    explicit PulseTrain(OutputQueue& outputs) : outputs_(outputs) {}

    /// A pulse at each point of `grid`, which is in the time of `clock`, at `output`.
    void begin(unsigned output, const Grid& grid, const GridClock& clock, Nanoseconds width,
               Nanoseconds now);
    void stop() { clock_ = nullptr; }
    /// The clock changed.
    void moved() {
        if (clock_ != nullptr) at_ = clock_->board_time(grid_.next());
    }

    /// Before each commit of the outputs: pulses are decided further ahead than words are
    /// committed.
    void poll(Nanoseconds now);

    Nanoseconds next_wake() const;

 private:
    void skip(Nanoseconds now);

    OutputQueue& outputs_;
    unsigned output_ = 0;
    Grid grid_;
    const GridClock* clock_ = nullptr;
    Nanoseconds width_ = 0;
    Nanoseconds at_ = 0;  ///< of the next pulse
};

}  // namespace versavis::firmware
