// SPDX-License-Identifier: BSD-3-Clause
// Holds each exposure record of a camera against its own fields, its grid and its neighbours.
#pragma once

#include <cstdint>
#include <optional>

#include "implausibility.hpp"
#include "majority_filter.hpp"
#include "running_estimate.hpp"
#include "settings/configuration.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// What no honest record of this camera says, whatever came before it.
std::optional<Implausibility> contradicts_itself(const wire::Exposure& record,
                                                 const CameraConfiguration& configuration);

/// A record and the exposure that the camera keeps to at that time; 0: it varies, or is unknown.
struct ExposureObservation {
    const wire::Exposure& record;
    Duration commanded;
};

/// The records that were believed. The board places each trigger half an expected exposure before
/// its grid point, so triggers follow from ticks; starts follow from triggers, by the camera's
/// latency; and ends from starts, while the camera's exposure is known.
class ExposureHistory {
 public:
    explicit ExposureHistory(const CameraConfiguration& configuration);

    std::optional<Implausibility> doubt(const ExposureObservation& exposure) const;
    void learn(const ExposureObservation& exposure);

    /// All may have moved: the next record is held against latency and exposure alone.
    void rebase() {
        newest_.reset();
        grid_known_ = false;
    }

    /// The grid may have moved; triggers are counted as before.
    void forget_grid() { grid_known_ = false; }

    /// The board said that so many of the next grid points have no trigger.
    void triggers_skipped(std::uint64_t count) { skips_ += count; }

    /// The newest one was of the same trigger, and said the same.
    bool repeats(const ExposureObservation& exposure) const;

    /// It was of the same trigger, and said something else.
    bool disputes_newest(const wire::Exposure& record) const;

 private:
    bool of_newest_trigger(const wire::Exposure& record) const {
        return newest_ && newest_->trigger == record.trigger;
    }

    /// Exposures that the expected one of a trigger may be among.
    static constexpr std::size_t remembered_lengths = 8;

    std::optional<Implausibility> number_doubt(const wire::Exposure& record) const;
    bool may_skip(const wire::Exposure& record, std::uint64_t points) const;
    std::optional<Implausibility> trigger_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> start_doubt(const wire::Exposure& record) const;
    std::optional<Implausibility> end_doubt(const ExposureObservation& exposure) const;
    Duration compensation(const wire::Exposure& record) const;

    Duration period_;
    bool slave_;
    Duration lengths_[remembered_lengths];
    std::size_t length_count_ = 0;
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

using ExposureValidator = MajorityFilter<ExposureHistory>;

}  // namespace versavis::daemon
