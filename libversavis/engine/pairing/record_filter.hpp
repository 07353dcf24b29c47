// SPDX-License-Identifier: BSD-3-Clause
// Holds each exposure record of a camera against its own fields, its grid and its neighbours.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/plausibility/delay_floor.hpp"
#include "engine/plausibility/implausibility.hpp"
#include "engine/plausibility/majority_filter.hpp"
#include "engine/plausibility/running_estimate.hpp"
#include "versavis/time.hpp"
#include "wire/messages.hpp"

namespace versavis::pairing {

/// What is configured of a camera that its records must agree with.
struct RecordLimits {
    Duration period = milliseconds(50);        ///< of the triggers, when none is left out
    Duration latency;                          ///< from trigger to start, at most
    Duration exposure = milliseconds(3);       ///< that the first triggers expect
    Duration max_exposure = milliseconds(50);  ///< after which the board gives up
    double grid_slew_ppm = 0;                  ///< by which the grid's rate may change
    bool wired = true;                         ///< its exposure line
    bool slave = false;                        ///< triggered by another camera's exposure line
    bool fixed_grid = false;                   ///< its grid points follow no clock but the board's

    bool operator==(const RecordLimits&) const = default;
};

/// A record as it came, and what was known then beside its own fields.
struct ReceivedRecord {
    wire::Exposure record{};
    Duration commanded;            ///< exposure that the camera keeps to at that time; 0: it varies
                                   ///< or is unknown
    std::uint64_t exchanges = 0;   ///< of the board's clock with the host's, until now
    std::int64_t expected_ns = 0;  ///< latest time of the board by the host's clock
    EventReason arrival = EventReason::none;  ///< what contradicts the time of its arrival
    bool clock_contradicted = false;          ///< exchanges contradict the estimate of the clock
    Promptness promptness = Promptness::not_recorded;
    /// Where the trigger lies by what the board said of its grid before, if no exposure is expected
    /// of it; 0: unknown.
    std::int64_t grid_ns = 0;
};

/// The newest instant that the record names.
BoardTime newest_instant(const wire::Exposure& record);

/// What no honest record of this camera says, whatever came before it.
std::optional<Implausibility> contradicts_itself(const wire::Exposure& record,
                                                 const RecordLimits& limits);

/// The records that were believed. The board places each trigger half an expected exposure before
/// its grid point, so triggers follow from ticks; starts follow from triggers, by the camera's
/// latency; and ends from starts, while the camera's exposure is known.
class RecordHistory {
 public:
    explicit RecordHistory(const RecordLimits& limits);

    std::optional<Implausibility> doubt(const ReceivedRecord& received) const;
    void learn(const ReceivedRecord& received);

    /// It is not believed, but the board may expect the exposure that it names, which varies.
    void see(const wire::Exposure& record);

    /// All may have moved: the next record is held against latency and exposure alone.
    void rebase() {
        newest_.reset();
        grid_.reset();
        grid_known_ = false;
    }

    /// The camera is started anew, and a grid that moves may have moved; triggers are counted as
    /// before.
    void forget_grid() { grid_known_ = false; }

    /// The record belongs where it says, but triggers were left out before it of which nothing is
    /// known: what the board said of them is lost.
    bool only_skips(const wire::Exposure& record) const;

    /// The board said that so many of the next grid points have no trigger.
    void triggers_skipped(std::uint64_t count) { skips_ += count; }

    /// By what the board said of its grid before: the record's grid point is where it should be,
    /// and not that of the records before; false: the reverse. None: that is unknown, decides
    /// nothing, or the record's trigger is not what is doubted.
    std::optional<bool> on_grid(const ReceivedRecord& received) const;

    /// The newest one was of the same trigger, and said the same.
    bool repeats(const ReceivedRecord& received) const;

    /// It was of the same trigger, and said something else.
    bool disputes_newest(const wire::Exposure& record) const;

 private:
    bool of_newest_trigger(const wire::Exposure& record) const {
        return newest_ && newest_->trigger == record.trigger;
    }

    /// Exposures that the expected one of a trigger may be among.
    static constexpr std::size_t remembered_lengths = 8;

    struct Lengths {
        Duration shortest;
        Duration longest;
    };

    /// Where the grid point of a tick lies.
    struct GridPoint {
        std::uint64_t tick = 0;
        BoardTime earliest;
        BoardTime latest;
    };

    std::optional<Implausibility> number_doubt(const wire::Exposure& record) const;
    bool may_skip(const wire::Exposure& record, std::uint64_t points) const;
    std::optional<Implausibility> trigger_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> grid_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> pace_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> start_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> end_doubt(const ReceivedRecord& received) const;
    Lengths lengths(const wire::Exposure& record) const;
    Duration compensation(const wire::Exposure& record) const;
    bool all_seen(const wire::Exposure& record) const;
    GridPoint by_trigger(const wire::Exposure& record, bool exposures_known) const;
    std::optional<GridPoint> predicted(std::uint64_t tick) const;
    void learn_grid(const wire::Exposure& record);

    Duration period_;
    bool slave_;
    bool fixed_grid_;
    std::optional<GridPoint> grid_;  ///< by the records so far, if it is fixed
    Duration lengths_[remembered_lengths];
    std::size_t length_count_ = 0;
    std::uint64_t seen_ = 0;  ///< trigger of the newest record, believed or not
    std::optional<wire::Exposure> newest_;
    std::optional<wire::Exposure> punctual_;  ///< the newest whose trigger did not leave late
    bool grid_known_ = false;                 ///< the next tick follows from the newest record's
    std::uint64_t skips_ = 0;                 ///< reported since the newest record
    Duration slew_;                           ///< by which a period may differ from the one before
    RunningEstimate pace_;                    ///< from one grid point to the next
    RunningEstimate latency_;
    RunningEstimate length_;
    Duration commanded_;
};

struct RecordVerdict {
    std::optional<Implausibility> doubt;  ///< none: the record is believed
    std::optional<Implausibility> step;   ///< it is, although this speaks against it: those before
                                          ///< were of another time or count
    bool overturned = false;  ///< records that were believed before it are void: which of them lied
                              ///< is unknown
};

/// The one judge of records, for the service and for whoever pairs its evidence again: a record is
/// believed when it agrees with itself, with the time of its arrival and with those before it; a
/// change when several records agree on it and their arrival confirms it, or when nothing but time
/// can decide. Not thread-safe.
class RecordFilter {
 public:
    explicit RecordFilter(const RecordLimits& limits);

    /// Others than before: it begins anew.
    void set_limits(const RecordLimits& limits);

    RecordVerdict judge(const ReceivedRecord& received);

    /// The verdict on the newest record.
    const RecordVerdict& verdict() const { return verdict_; }

    /// The next record may belong anywhere.
    void forget() { filter_.forget(); }

    void forget_grid() { filter_.believed().forget_grid(); }
    void triggers_skipped(std::uint64_t count) { filter_.believed().triggers_skipped(count); }

    /// The newest believed one was of the same trigger, and said something else.
    bool disputes_newest(const wire::Exposure& record) {
        return filter_.believed().disputes_newest(record);
    }

 private:
    bool may_adopt(const ReceivedRecord& received, const Implausibility& doubt);

    RecordLimits limits_;
    MajorityFilter<RecordHistory> filter_;
    StepPromptness step_promptness_;
    RecordVerdict verdict_;
};

}  // namespace versavis::pairing
