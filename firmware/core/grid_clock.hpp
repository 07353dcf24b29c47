// SPDX-License-Identifier: BSD-3-Clause
// The one grid that all cameras share: its origin, and how it follows another board's sync pulses,
// or the host's time.
#pragma once

#include "base/hal.hpp"
#include "candidate_pulse_train.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// Board time as a straight line over grid time, through an anchor; without divisions, which are
/// slow on small processors. Exact to a nanosecond within some minutes of the anchor.
class GridLine {
 public:
    GridLine() = default;
    /// Board time passes faster than grid time by `pace_ppb`: at most 1900 ppm either way.
    GridLine(Nanoseconds board, Nanoseconds grid, std::int64_t pace_ppb);

    std::int64_t pace_ppb() const { return pace_ppb_; }

    Nanoseconds board() const { return board_; }
    Nanoseconds grid() const { return grid_; }

    Nanoseconds board_time(Nanoseconds grid_time) const;

    /// Not after the true one, and close before it: a place to begin a search with.
    Nanoseconds grid_time(Nanoseconds board_time) const;

 private:
    /// since * pace_ / 2^40, rounded, in two halves that do not overflow.
    Nanoseconds gained(Nanoseconds since) const;

    Nanoseconds board_ = 0;
    Nanoseconds grid_ = 0;
    std::int64_t pace_ppb_ = 0;
    std::int64_t pace_ = 0;  ///< parts of 2^40
};

/// Grid time counts from the origin. By itself it runs like board time. While sync pulses arrive,
/// it runs like the clock of the board that sends them: between two pulses at the pace of the two
/// before. Pulses that do not fit are ignored, until they fit each other: then it slews to them.
/// When aligned, it runs at the pace that the host gives and approaches the host's whole
/// seconds without a step.
class GridClock {
 public:
    /// Grid time 0 is at `origin`; `sync_period` by the sender's clock; 0: unknown, pulses are not
    /// followed. `since`: from the pulse before the one at `origin`; 0: the pace is not known yet.
    void begin(Nanoseconds origin, Nanoseconds sync_period, Nanoseconds since = 0);

    Nanoseconds board_time(Nanoseconds grid_time) const;

    /// Not after the true one, and close before it: a place to begin a search with.
    Nanoseconds grid_time(Nanoseconds board_time) const;

    enum class Sync : std::uint8_t {
        ignored,   ///< no sender is followed, or the pulse is one more that does not fit
        followed,  ///< it fits
        lost,      ///< it is the first that does not fit
        taken,     ///< the grid goes to it, and to those that will fit it
    };
    struct SyncPulse {
        Sync what = Sync::ignored;
        Nanoseconds off = 0;  ///< from where it was expected to where it came
    };
    /// `running`: cameras run, and the grid must not step.
    SyncPulse sync_pulse(Nanoseconds at, bool running);

    /// lost, too: no pulse came for a while, or the grid is still on its way to the pulses.
    wire::SyncState sync_state(Nanoseconds now) const;

    /// A whole second of grid time belongs at `second`, and from there on board time passes faster
    /// by `pace_ppb`. From `now` on the nearest whole second is moved there, at no more than
    /// `max_slew_ppb` beyond the pace. Sync pulses are no longer followed.
    void align(Nanoseconds second, std::int32_t pace_ppb, std::uint32_t max_slew_ppb,
               Nanoseconds now);

    /// The same, at once.
    void place(Nanoseconds second, std::int32_t pace_ppb);

    /// How far place() would move the grid there.
    Nanoseconds misplaced(Nanoseconds second) const;

 private:
    static constexpr Nanoseconds no_bend = INT64_MIN;

    void steer(const GridLine& target, std::int64_t max_slew_ppb, Nanoseconds now);
    SyncPulse take_rival(Nanoseconds at, Nanoseconds off, bool running);

    Nanoseconds period_ = 0;
    GridLine line_;      ///< from the newest pulse, or towards the second given by the host
    GridLine approach_;  ///< until line_ is reached
    Nanoseconds bend_ = no_bend;  ///< grid time from which on line_ holds
    bool pace_known_ = false;
    bool fits_ = true;              ///< the newest sync pulse did
    Nanoseconds newest_pulse_ = 0;  ///< of those that fit
    CandidatePulseTrain candidate_;
};

}  // namespace versavis::firmware
