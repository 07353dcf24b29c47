// SPDX-License-Identifier: BSD-3-Clause
// Camera and IMU of a recording against each other: offset in time, rotation.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "evaluate/feature_rotation.hpp"
#include "evaluate/rotation_offset.hpp"
#include "recording/recording.hpp"

namespace versavis::client {

struct ImuEvaluationSettings {
    std::string camera;  ///< empty: the only one
    std::string imu;
    std::string calibration;  ///< file of Kalibr's; empty: the recording's attachment
    double focal = 0;         ///< pixels; 0: by the calibration
    Duration range = milliseconds(500);
    double from_s = 0;
    double to_s = 0;                                ///< 0: all
    std::function<bool(std::size_t frames)> watch;  ///< false: stop
};

struct ImuEvaluation {
    std::string camera;
    std::string imu;
    RotationOffset found;
    std::uint64_t frames = 0;
    std::uint64_t followed = 0;    ///< frames whose rotation since the one before is known
    std::uint64_t unmeasured = 0;  ///< frames whose stamp is not a measured middle
    Duration filter_delay;         ///< of the IMU, already subtracted from its stamps
    std::optional<double> calibrated_shift_s;  ///< timeshift_cam_imu of the calibration
    std::vector<std::string> notes;
};

/// The camera's model from a camchain, by name of the camera, or by --focal.
Expected<CameraModel> camera_model(const Recording& recording,
                                   const ImuEvaluationSettings& settings,
                                   const FrameMetadata& frame, ImuEvaluation& evaluation);

struct SeenMotion {
    std::vector<FrameRotation> rotations;
    std::vector<GyroSample> gyro;
};

/// Reads both, of the span in which the stamps of the IMU are continuous; all but
/// `evaluation.found` is known then.
Expected<SeenMotion> seen_motion(const Recording& recording, const ImuEvaluationSettings& settings,
                                 ImuEvaluation& evaluation);

Expected<ImuEvaluation> evaluate_imu(const Recording& recording,
                                     const ImuEvaluationSettings& settings);

nlohmann::json to_json(const ImuEvaluation& evaluation);
std::string to_text(const ImuEvaluation& evaluation);

}  // namespace versavis::client
