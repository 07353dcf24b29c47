// SPDX-License-Identifier: BSD-3-Clause
// Sets up an open camera by its preset and configuration, all of it checked before the first frame.
#pragma once

#include "camera/aravis_node_map.hpp"
#include "camera/preset_run.hpp"
#include "camera/sensor_features.hpp"
#include "settings/camera_preset.hpp"
#include "settings/configuration.hpp"
#include "settings/line_delays.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// A value that frames carry.
struct ChunkFeature {
    std::string name;  ///< empty: they do not
    bool is_integer = false;
};

/// What the setup found out of the camera.
struct CameraSetup {
    std::string vendor;
    std::string model;
    std::string serial;
    std::string preset;
    LineDelays lines;
    std::vector<StepResult> steps;  ///< of the preset
    std::vector<std::pair<std::string, std::string>>
        watched;                   ///< features with the values that must stay as they are
    std::string exposure_feature;  ///< in microseconds; empty: it has none that counts
    ChunkFeature chunk_exposure;   ///< the same of each frame, in units of ...
    double chunk_exposure_unit_us = 1;
    ChunkFeature chunk_gain;
    SensorFeatures sensor;
    std::uint64_t payload = 0;  ///< bytes of a frame, chunks included
    bool chunks = false;        ///< frames carry their exposure time
    bool has_clock = true;      ///< its time stamps are its own, not the host's
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< by configuration or preset
};

/// `setup` holds what was found and done, also after an error. Errors name the feature and what the
/// camera allows, or all that the preset needs and the camera lacks or does not keep.
Expected<> set_up_camera(ArvCamera* camera, AravisNodeMap& nodes,
                         const CameraConfiguration& configuration,
                         const std::vector<CameraPreset>& presets, CameraSetup& setup);

/// Exposure time as `feature` has it, in microseconds; zero when the camera changes it by itself,
/// or does not say.
Duration fixed_exposure(const AravisNodeMap& nodes, const std::string& feature);

/// As the registers have it now. No gain while the camera changes it by itself.
SensorState sensor_state(const AravisNodeMap& nodes, const SensorFeatures& features);

}  // namespace versavis::daemon
