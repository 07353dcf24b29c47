// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/feature_rotation.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

constexpr int scene_width = 320;
constexpr int scene_height = 240;

/// A texture at infinity: waves over the direction in which one looks.
class Sky {
 public:
    Sky() {
        std::mt19937 random(3);
        std::uniform_real_distribution<double> any(-1, 1);
        for (int i = 0; i < 24; ++i) {
            // Compilers evaluate the arguments of a call in the order they like.
            const auto along = Eigen::Vector3d::NullaryExpr([&] { return any(random); }).eval();
            const double size = 25 + 60 * std::abs(any(random));
            waves_.push_back({along.normalized() * size, 4 * any(random)});
        }
    }
    double operator()(const Eigen::Vector3d& direction) const {
        double sum = 0;
        for (const Wave& wave : waves_) sum += std::sin(wave.vector.dot(direction) + wave.phase);
        return 128 + 18 * sum;
    }

 private:
    struct Wave {
        Eigen::Vector3d vector;
        double phase;
    };
    std::vector<Wave> waves_;
};

/// The direction that a pixel shows, by inverting the model step by step.
Eigen::Vector3d direction(const CameraModel& camera, double u, double v) {
    const double x = (u - camera.cx) / camera.fx;
    const double y = (v - camera.cy) / camera.fy;
    double sx = x;
    double sy = y;
    const auto& k = camera.coefficients;
    for (int i = 0; i < 12 && camera.distortion != Distortion::none; ++i) {
        const double r2 = sx * sx + sy * sy;
        if (camera.distortion == Distortion::radtan) {
            const double radial = 1 + k[0] * r2 + k[1] * r2 * r2;
            sx = (x - 2 * k[2] * sx * sy - k[3] * (r2 + 2 * sx * sx)) / radial;
            sy = (y - 2 * k[3] * sx * sy - k[2] * (r2 + 2 * sy * sy)) / radial;
        } else {
            const double theta = std::atan(std::sqrt(r2));
            const double bent = theta * (1 + k[0] * theta * theta);
            const double ratio = r2 > 0 ? std::sqrt(r2) / bent : 1;
            sx = x * ratio;
            sy = y * ratio;
        }
    }
    return Eigen::Vector3d(sx, sy, 1).normalized();
}

/// `orientation`: turns the camera's axes into the sky's. A part of the picture may stay as it is,
/// as the hood of a car does.
GreyImage picture(const CameraModel& camera, const Eigen::Quaterniond& orientation,
                  int hood_rows = 0) {
    static const Sky sky;
    GreyImage image{scene_width, scene_height, {}};
    for (int v = 0; v < scene_height; ++v)
        for (int u = 0; u < scene_width; ++u) {
            const Eigen::Vector3d seen = direction(camera, u, v);
            const double grey = v >= scene_height - hood_rows ? sky(seen) : sky(orientation * seen);
            image.pixels.push_back(static_cast<std::uint8_t>(std::clamp(grey, 0.0, 255.0)));
        }
    return image;
}

CameraModel pinhole() { return {220, 220, 160, 120, Distortion::none, {}}; }

FrameRotation turned(const CameraModel& camera, const Eigen::Vector3d& rotation,
                     int hood_rows = 0) {
    auto tracker = FeatureRotation::create(camera);
    REQUIRE(tracker);
    const Eigen::Quaterniond first = rotation_by({0.3, 0.2, -0.1});
    const auto none = tracker->add(picture(camera, first, hood_rows), {1000});
    REQUIRE(none);
    CHECK_FALSE(*none);
    const auto found =
        tracker->add(picture(camera, first * rotation_by(rotation), hood_rows), {2000});
    REQUIRE(found);
    REQUIRE(*found);
    return **found;
}

}  // namespace

TEST_CASE("feature_rotation: signs and sizes about each axis", "[feature_rotation]") {
    for (const Eigen::Vector3d& rotation :
         {Eigen::Vector3d(0.03, 0, 0), Eigen::Vector3d(0, 0.03, 0), Eigen::Vector3d(0, 0, 0.03),
          Eigen::Vector3d(-0.05, 0.08, -0.1), Eigen::Vector3d(0, 0, 0)}) {
        const FrameRotation found = turned(pinhole(), rotation);
        CAPTURE(rotation.transpose(), found.rotation.transpose(), found.sigma.transpose());
        const auto off_in_sigmas = (found.rotation - rotation).cwiseQuotient(found.sigma);
        CHECK(off_in_sigmas.cwiseAbs().maxCoeff() < 4);
        CHECK(found.from == OutputTime{1000});
        CHECK(found.to == OutputTime{2000});
        CHECK(found.sigma.minCoeff() > 0);
        CHECK(found.sigma.maxCoeff() < 1e-3);
        CHECK(found.sigma.z() > found.sigma.x());  // a narrow view shows roll worst
    }
}

TEST_CASE("feature_rotation: a lens that bends is straightened", "[feature_rotation]") {
    const Eigen::Vector3d rotation(-0.02, 0.04, 0.03);
    CameraModel camera = pinhole();
    camera.distortion = Distortion::radtan;
    camera.coefficients = {-0.25, 0.06, 1e-3, -5e-4};
    CHECK((turned(camera, rotation).rotation - rotation).norm() < 4e-4);
    camera.distortion = Distortion::equidistant;
    camera.coefficients = {0.02, 0, 0, 0};
    CHECK((turned(camera, rotation).rotation - rotation).norm() < 4e-4);
}

TEST_CASE("feature_rotation: what turns along does not pull", "[feature_rotation]") {
    const Eigen::Vector3d rotation(0.02, 0.04, -0.03);
    CHECK((turned(pinhole(), rotation, 80).rotation - rotation).norm() < 8e-4);
}

TEST_CASE("feature_rotation: nothing to follow, nothing reported", "[feature_rotation]") {
    auto tracker = FeatureRotation::create(pinhole());
    REQUIRE(tracker);
    const GreyImage blank{scene_width, scene_height,
                          std::vector<std::uint8_t>(scene_width * scene_height, 100)};
    REQUIRE(tracker->add(blank, {1}));
    const auto second = tracker->add(blank, {2});
    REQUIRE(second);
    CHECK_FALSE(*second);
    const auto cut = tracker->add(picture(pinhole(), rotation_by({0, 0, 0})), {3});
    REQUIRE(cut);
    CHECK_FALSE(*cut);
    const auto elsewhere = tracker->add(picture(pinhole(), rotation_by({0, 2, 0})), {4});
    REQUIRE(elsewhere);
    CHECK_FALSE(*elsewhere);
}

TEST_CASE("feature_rotation: odd sizes and cameras are reported", "[feature_rotation]") {
    CHECK_FALSE(FeatureRotation::create({}));
    auto tracker = FeatureRotation::create(pinhole());
    REQUIRE(tracker);
    CHECK_FALSE(tracker->add({10, 10, {1, 2, 3}}, {1}));
    CHECK_FALSE(tracker->add({}, {1}));
    REQUIRE(tracker->add({64, 48, std::vector<std::uint8_t>(64 * 48)}, {1}));
    const auto other = tracker->add({48, 64, std::vector<std::uint8_t>(64 * 48)}, {2});
    REQUIRE_FALSE(other);
    CHECK_THAT(other.error().message(), Contains("48 x 64"));
    CHECK(tracker->add({64, 48, std::vector<std::uint8_t>(64 * 48)}, {3}));
    auto tiny = FeatureRotation::create(pinhole());
    REQUIRE(tiny);
    CHECK(tiny->add({2, 1, {1, 2}}, {1}));
    CHECK(tiny->add({2, 1, {1, 2}}, {2}));
}
