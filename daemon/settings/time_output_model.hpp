// SPDX-License-Identifier: BSD-3-Clause
// What LiDARs accept as pulse and sentence; docs/user/lidar.md has the sources.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace versavis::daemon {

struct TimeOutputModel {
    std::string name;
    bool serial_inverted;  ///< its input has the levels of RS-232
    double shortest_pulse_ms;
    double longest_pulse_ms;
    std::vector<std::string> sentences;  ///< of which it reads one; empty: any
    std::vector<unsigned> bauds;         ///< empty: any
    std::optional<double> pause_ms;      ///< from the pulse's end to the first sentence, at least
    double latest_begin_ms;              ///< of the first sentence, after the pulse's begin
    double latest_end_ms;                ///< of the last one
};

/// "generic" first.
const std::vector<TimeOutputModel>& time_output_models();

}  // namespace versavis::daemon
