// SPDX-License-Identifier: BSD-3-Clause
// Time offset and rotation between a camera and an IMU, from how both saw the same motion.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "evaluate/gyro_track.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// How the camera turned between two frames: with b1 and b2 the directions in which the two show
/// the same distant point, b1 = rotation * b2.
struct FrameRotation {
    OutputTime from;
    OutputTime to;
    Eigen::Vector3d rotation;  ///< axis times angle, rad, in the camera's axes
    Eigen::Vector3d sigma;     ///< rad, about each axis; what counts is the ratio between them
};

struct RotationOffset {
    double offset_s = 0;  ///< time of the IMU = time of the frame + offset
    double offset_sigma_s = 0;
    bool rotation_shown =
        false;  ///< else the motion was about one axis, and leaves what follows open
    Eigen::Quaterniond camera_from_imu;  ///< turns the IMU's axes into the camera's
    Eigen::Vector3d rotation_sigma;      ///< rad, about the camera's axes
    Eigen::Vector3d gyro_bias;           ///< rad/s, in the IMU's axes
    Eigen::Vector3d gyro_bias_sigma;
    double camera_scale =
        1;                ///< by which the camera's turns about x and y are too large, taken off
    double residual = 0;  ///< rad, robust, of a usual component of a rotation between frames
    double outlier_share = 0;  ///< of rotations that count for less than half
    std::size_t rotations = 0;
};

struct RotationOffsetSettings {
    Duration range = milliseconds(500);  ///< offsets within +- this are tried
};

/// Errors: too few frames or samples; the motion does not show the offset, and why.
Expected<RotationOffset> rotation_offset(const std::vector<FrameRotation>& frames,
                                         const std::vector<GyroSample>& gyro,
                                         const RotationOffsetSettings& settings = {});

}  // namespace versavis::client
