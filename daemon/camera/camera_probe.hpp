// SPDX-License-Identifier: BSD-3-Clause
// Sets up one camera as the service would, and reports what it is, what was set, and what stands in
// the way.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "camera/camera_setup.hpp"
#include "camera/camera_state.hpp"

namespace versavis::daemon {

struct ProbeReport {
    std::string device;
    CameraState state = CameraState::streaming;  ///< that the service would have it in
    std::string problem;                         ///< why; empty: nothing stands in the way
    CameraSetup setup;
    std::vector<std::pair<std::string, std::string>> features;  ///< with their values
    std::string description;                                    ///< as the camera has it
};

/// Looks for the camera, opens it and sets it up. Nothing else may control it meanwhile.
/// `features`: all features are read, too, which takes seconds.
ProbeReport probe_camera(const CameraConfiguration& configuration,
                         const std::filesystem::path& preset_directory, bool features);

/// For a terminal.
std::string to_text(const ProbeReport& report);

/// A JSON object: all of the report, and the draft of a preset if the base preset was taken.
std::string to_json(const ProbeReport& report);

/// What a preset for this maker may begin with: the lines and sources that the camera offers.
std::string draft_preset(const ProbeReport& report);

}  // namespace versavis::daemon
