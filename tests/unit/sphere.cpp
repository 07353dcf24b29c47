// SPDX-License-Identifier: BSD-3-Clause
#include "sphere.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

using versavis::rig::Pinhole;
using versavis::rig::Sphere;

namespace {

constexpr Pinhole small_camera{160, 120, 130};

std::vector<std::uint16_t> view(const Sphere& world, const Eigen::Matrix3d& attitude) {
    std::vector<std::uint16_t> sums(std::size_t{small_camera.width} * small_camera.height);
    world.add_view(small_camera, attitude, sums);
    return sums;
}

}  // namespace

TEST_CASE("sphere: each pixel shows the world in its direction, whatever the attitude") {
    const Sphere world(small_camera.focal_px, 3);
    for (int i = 0; i < 40; ++i) {
        const Eigen::Matrix3d attitude =
            (Eigen::AngleAxisd(0.31 * i, Eigen::Vector3d::UnitZ()) *
             Eigen::AngleAxisd(0.77 * i, Eigen::Vector3d(1, 2, 3).normalized()))
                .toRotationMatrix();
        const auto sums = view(world, attitude);
        double difference = 0;
        for (std::uint32_t y = 0; y < small_camera.height; ++y)
            for (std::uint32_t x = 0; x < small_camera.width; ++x)
                difference += std::abs(sums[std::size_t{y} * small_camera.width + x] / 16.0 -
                                       world.brightness(attitude * small_camera.ray(x, y)));
        REQUIRE(difference / static_cast<double>(sums.size()) < 1);
    }
}

TEST_CASE("sphere: there is something to see in each direction, and the seed draws it") {
    const Sphere world(small_camera.focal_px, 3);
    const Sphere other(small_camera.focal_px, 4);
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)})
        for (const double angle : {1.57, 3.14, 4.71}) {
            const Eigen::Matrix3d attitude = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
            const auto sums = view(world, attitude);
            double mean = 0;
            double squares = 0;
            for (const std::uint16_t sum : sums) {
                mean += sum / 16.0 / static_cast<double>(sums.size());
                squares += sum / 16.0 * sum / 16.0 / static_cast<double>(sums.size());
            }
            CHECK(std::sqrt(squares - mean * mean) > 15);
            CHECK(sums != view(other, attitude));
        }
}
