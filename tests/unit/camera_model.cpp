// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/camera_model.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis::client;

namespace {

/// Where a direction is seen, as the models are defined.
Eigen::Vector2d pixel_of(const CameraModel& camera, const Eigen::Vector3d& bearing) {
    const auto& k = camera.coefficients;
    Eigen::Vector2d at = bearing.hnormalized();
    const double r2 = at.squaredNorm();
    if (camera.distortion == Distortion::radtan) {
        const double radial = 1 + k[0] * r2 + k[1] * r2 * r2;
        const double xy = at.x() * at.y();
        at = {at.x() * radial + 2 * k[2] * xy + k[3] * (r2 + 2 * at.x() * at.x()),
              at.y() * radial + k[2] * (r2 + 2 * at.y() * at.y()) + 2 * k[3] * xy};
    }
    if (camera.distortion == Distortion::equidistant) {
        const double angle = std::atan(std::sqrt(r2));
        const double a2 = angle * angle;
        const double made = angle * (1 + k[0] * a2 + k[1] * a2 * a2 + k[2] * std::pow(a2, 3) +
                                     k[3] * std::pow(a2, 4));
        if (r2 > 0) at *= made / std::sqrt(r2);
    }
    return {camera.fx * at.x() + camera.cx, camera.fy * at.y() + camera.cy};
}

}  // namespace

TEST_CASE("camera_model: a pixel shows the direction that is seen there, for each lens") {
    const CameraModel camera = GENERATE(
        CameraModel{460, 458, 367, 248, Distortion::none, {}},
        CameraModel{460, 458, 367, 248, Distortion::radtan, {-0.28, 0.07, 0.0002, 0.00002}},
        CameraModel{190, 191, 254, 256, Distortion::equidistant, {0.0035, 0.0007, -0.002, 0.0002}});
    for (double x = -0.8; x <= 0.8; x += 0.2)
        for (double y = -0.5; y <= 0.5; y += 0.125) {
            const Eigen::Vector3d bearing = Eigen::Vector3d(x, y, 1).normalized();
            const Eigen::Vector2d pixel = pixel_of(camera, bearing);
            CHECK((bearing_of(camera, pixel.x(), pixel.y()) - bearing).norm() < 1e-5);
        }
}

TEST_CASE("camera_model: the axis is the axis") {
    CameraModel camera{100, 100, 50, 40, Distortion::equidistant, {0.1, 0, 0, 0}};
    CHECK(bearing_of(camera, 50, 40) == Eigen::Vector3d::UnitZ());
}
