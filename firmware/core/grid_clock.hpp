// SPDX-License-Identifier: BSD-3-Clause
// The one grid that all cameras share: its origin, and how it follows another board's sync pulses.
#pragma once

#include "hal.hpp"

namespace versavis::firmware {

/// Grid time counts from the origin. By itself it passes as board time does; while sync pulses come, it
/// passes as the board that sends them has it: between two pulses at the pace of the two before.
class GridClock {
 public:
    /// Grid time 0 is at `origin`; `sync_period` as the sender has it, 0: unknown, pulses are not followed.
    void begin(Nanoseconds origin, Nanoseconds sync_period) {
        *this = {};
        origin_ = anchor_ = origin;
        period_ = sync_period;
    }

    Nanoseconds board_time(Nanoseconds grid_time) const {
        const Nanoseconds since = grid_time - anchor_grid_;
        if (pace_ppb_ == 0) return anchor_ + since;  // divisions of 64 bits take long on small processors
        const Nanoseconds whole = since / billion * pace_ppb_ + since % billion * pace_ppb_ / billion;
        return anchor_ + since + whole;
    }

    /// Not after the true one, and close before it: a place to begin a search with.
    Nanoseconds grid_time(Nanoseconds board_time) const {
        const Nanoseconds since = board_time - anchor_;
        if (pace_ppb_ == 0) return anchor_grid_ + since;
        const Nanoseconds margin = (since < 0 ? -since : since) / 1'000'000 + 1;
        return anchor_grid_ + since - since / billion * pace_ppb_ - since % billion * pace_ppb_ / billion -
               margin;
    }

    /// False: the pulse is none of the sender's, and is not followed.
    bool sync_pulse(Nanoseconds at);

 private:
    static constexpr Nanoseconds billion = 1'000'000'000;

    Nanoseconds origin_ = 0;
    Nanoseconds period_ = 0;
    Nanoseconds anchor_ = 0;       ///< board time of the newest pulse
    Nanoseconds anchor_grid_ = 0;  ///< its grid time
    std::int64_t pace_ppb_ = 0;    ///< board time passes so much faster than grid time
    bool pace_known_ = false;
};

}  // namespace versavis::firmware
