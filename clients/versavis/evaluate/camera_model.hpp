// SPDX-License-Identifier: BSD-3-Clause
// A pinhole camera with its lens: which direction a pixel shows.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace versavis::client {

enum class Distortion { none, radtan, equidistant };

/// Pixels; axes to the right, down and ahead.
struct CameraModel {
    double fx = 0;
    double fy = 0;
    double cx = 0;
    double cy = 0;
    Distortion distortion = Distortion::none;
    std::array<double, 4> coefficients{};  ///< radtan: k1, k2, p1, p2; equidistant: k1 to k4
};

/// A unit vector. Source of the distortions: Brown 1966; Kannala and Brandt 2006, as OpenCV and
/// Kalibr use them.
Eigen::Vector3d bearing_of(const CameraModel& camera, double x, double y);

/// Of pictures in which each pixel is the mean of a square of `factor` pixels.
CameraModel reduced(CameraModel camera, std::uint32_t factor);

}  // namespace versavis::client
