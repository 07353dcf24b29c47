// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/camera_model.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace versavis::client {

namespace {

/// Steps towards the point that the lens moved. If lower, strong lenses leave some hundredths of a
/// pixel at the corners.
constexpr int steps = 20;

/// Without distortion; both in units of the focal length.
Eigen::Vector2d without_radtan(const std::array<double, 4>& k, const Eigen::Vector2d& seen) {
    Eigen::Vector2d at = seen;
    for (int i = 0; i < steps; ++i) {
        const double square = at.squaredNorm();
        const double radial = 1 + square * (k[0] + square * k[1]);
        const double product = at.x() * at.y();
        const Eigen::Vector2d tangential{
            2 * k[2] * product + k[3] * (square + 2 * at.x() * at.x()),
            k[2] * (square + 2 * at.y() * at.y()) + 2 * k[3] * product};
        at = (seen - tangential) / radial;
    }
    return at;
}

/// The angle from the axis, of which the lens makes `seen`: by Newton.
double angle_of(const std::array<double, 4>& k, double seen) {
    double angle = seen;
    for (int i = 0; i < steps; ++i) {
        const double s = angle * angle;
        const double made = angle * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
        const double slope = 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
        angle -= (made - seen) / slope;
    }
    return angle;
}

}  // namespace

Eigen::Vector3d bearing_of(const CameraModel& camera, double x, double y) {
    const Eigen::Vector2d seen((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy);
    if (camera.distortion == Distortion::equidistant) {
        const double radius = seen.norm();
        if (radius == 0) return Eigen::Vector3d::UnitZ();
        const double angle = angle_of(camera.coefficients, radius);
        const Eigen::Vector2d aside = seen / radius * std::sin(angle);
        return {aside.x(), aside.y(), std::cos(angle)};
    }
    const Eigen::Vector2d at =
        camera.distortion == Distortion::radtan ? without_radtan(camera.coefficients, seen) : seen;
    return at.homogeneous().normalized();
}

CameraModel reduced(CameraModel camera, std::uint32_t factor) {
    camera.fx /= factor;
    camera.fy /= factor;
    camera.cx = (camera.cx + 0.5) / factor - 0.5;  // pixel 0 has its middle at 0
    camera.cy = (camera.cy + 0.5) / factor - 0.5;
    return camera;
}

}  // namespace versavis::client
