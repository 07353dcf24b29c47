// SPDX-License-Identifier: BSD-3-Clause
// Proves the wiring of all cameras: sends pulses at one output at a time, and looks at the edges
// and frames that follow.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "check/wiring.hpp"
#include "settings/configuration.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

struct CameraCheckReport {
    std::vector<CameraWiring> cameras;
    bool right() const;
};

/// Takes a minute, and board and cameras for itself; their settings are put back. `say` is given a
/// line for each step. Error: the board does not answer or goes, or no camera can be set up.
Expected<CameraCheckReport> check_cameras(const Configuration& configuration,
                                          const std::function<void(const std::string&)>& say);

/// For a terminal.
std::string to_text(const CameraCheckReport& report);

/// A JSON object.
std::string to_json(const CameraCheckReport& report);

}  // namespace versavis::daemon
