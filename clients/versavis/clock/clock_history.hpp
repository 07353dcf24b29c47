// SPDX-License-Identifier: BSD-3-Clause
// How an estimator of the board's clock behaves on recorded exchanges.
#pragma once

#include <string>
#include <vector>

#include "clock/clock_replay.hpp"

namespace versavis::client {

/// State of the estimator after one exchange.
struct ClockPoint {
    double time_s = 0;     ///< since the first exchange
    double offset_ns = 0;  ///< host minus board clock, relative to the first exchange
    double sigma_ns = 0;   ///< of the offset
    double skew_ppm = 0;   ///< host clock against board clock
    double skew_sigma_ppm = 0;
    double residual_ns = 0;    ///< measured midpoint minus estimate before this exchange
    double innovation_ns = 0;  ///< what this exchange, and one-way messages since the last, changed
};

/// Replays the recording; one point per exchange, in order of time.
std::vector<ClockPoint> clock_history(const ClockRecording& recording, ClockEstimator& estimator);

/// One row per point, below the names of its fields.
std::string to_csv(const std::vector<ClockPoint>& history);

struct ClockHistorySettings {
    std::string exchanges;
    std::string oneway;
    std::string out;
    EstimatorKind estimator = EstimatorKind::envelope;
};

/// Returns the number of rows written. `out` appears complete or not at all.
Expected<std::size_t> write_clock_history(const ClockHistorySettings& settings);

}  // namespace versavis::client
