// SPDX-License-Identifier: BSD-3-Clause
// The lens of a camera as Kalibr calibrated it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "evaluate/camera_model.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// The text of a camchain.yaml, and what errors call it.
struct Camchain {
    std::string text;
    std::string where;
};

struct CameraCalibration {
    CameraModel model;
    std::optional<double> time_shift_s;  ///< timeshift_cam_imu
};

Expected<Camchain> read_camchain(const std::string& path);

/// Errors: no such camera, another size, a model that is not supported.
Expected<CameraCalibration> calibration_of(const Camchain& camchain, const std::string& camera,
                                           std::uint32_t width, std::uint32_t height);

/// Without distortion, and its axis in the middle of the picture.
CameraModel pinhole(double focal, std::uint32_t width, std::uint32_t height);

}  // namespace versavis::client
