// SPDX-License-Identifier: BSD-3-Clause
// Sets up an open camera by its preset and configuration, all of it checked before the first frame.
#pragma once

#include "camera/camera_preset.hpp"
#include "camera/genicam.hpp"
#include "camera/line_delays.hpp"
#include "configuration/configuration.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// What the setup found out of the camera.
struct CameraSetup {
    std::string vendor;
    std::string model;
    std::string serial;
    std::string preset;
    LineDelays lines;
    std::string exposure_feature;  ///< in microseconds; empty: it has none
    std::uint64_t payload = 0;     ///< bytes of a frame, chunks included
    bool chunks = false;           ///< frames carry their exposure time
    bool has_clock = true;         ///< its time stamps are its own, not the host's
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< by configuration or preset
};

/// Errors name the feature and what the camera allows, or all that the preset expects and the
/// camera lacks.
Expected<CameraSetup> set_up_camera(ArvCamera* camera, const CameraConfiguration& configuration,
                                    const std::vector<CameraPreset>& presets);

/// Exposure time as it is set; zero when the camera changes it by itself, or does not tell.
Duration fixed_exposure(ArvDevice* device, const CameraSetup& setup);

}  // namespace versavis::daemon
