// SPDX-License-Identifier: BSD-3-Clause
// Features and gyro of the rig's moving world: signs, axes, offset.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "camera_view.hpp"
#include "evaluate/feature_rotation.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

const HostTime scene_begin{1'000'000'000};

struct Scene {
    std::vector<FrameRotation> frames;
    std::vector<GyroSample> gyro;
    Eigen::Quaterniond camera_from_imu;
};

/// Frames at 20 Hz, stamped in the middle of their exposure, and samples at 200 Hz.
Scene look(double seconds_long, Duration exposure, std::uint64_t seed) {
    rig::CameraScenario camera;
    camera.width = 320;
    camera.height = 240;
    camera.blur_steps = 8;
    camera.noise = 2;
    camera.imu_rotation_deg = {80, -20, 30};
    rig::Scenario scenario;
    scenario.seed = seed;
    scenario.motion.nods = false;
    scenario.cameras = {camera};
    const rig::Surroundings surroundings(scene_begin, scenario);
    const rig::CameraView view(scenario, camera, surroundings);
    const rig::Pinhole pinhole = view.pinhole();
    auto tracker = FeatureRotation::create(
        {pinhole.focal_px, pinhole.focal_px, 159.5, 119.5, Distortion::none, {}});
    REQUIRE(tracker);
    Scene scene;
    scene.camera_from_imu = rotation_by(Eigen::Vector3d(80, -20, 30) * M_PI / 180);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 2.4e-4 * std::sqrt(200));
    const Duration all{static_cast<std::int64_t>(seconds_long * 1e9)};
    for (Duration t{0}; t < all + seconds(2); t = t + milliseconds(5)) {
        Eigen::Vector3d rate = surroundings.motion.rate_rad_s(scene_begin + t);
        for (int i = 0; i < 3; ++i) rate[i] += normal(random);
        scene.gyro.push_back({{(scene_begin + t).ns}, rate});
    }
    std::uint64_t serial = 0;
    for (Duration t = seconds(1); t < all + seconds(1); t = t + milliseconds(50)) {
        GreyImage image{320, 240, std::vector<std::uint8_t>(std::size_t{320} * 240)};
        view.paint(scene_begin + t - exposure / 2, scene_begin + t + exposure / 2, ++serial,
                   image.pixels);
        const auto rotation = tracker->add(std::move(image), {(scene_begin + t).ns});
        REQUIRE(rotation);
        if (*rotation) scene.frames.push_back(**rotation);
    }
    return scene;
}

}  // namespace

TEST_CASE("feature_rotation_scene: the rig's world shows no offset, and the right axes",
          "[statistics]") {
    const Duration exposure = GENERATE(milliseconds(1), milliseconds(5));
    const Scene scene = look(15, exposure, 4);
    CHECK(scene.frames.size() > 270);
    const auto found = rotation_offset(scene.frames, scene.gyro);
    REQUIRE(found);
    CAPTURE(found->offset_s, found->offset_sigma_s, found->residual, found->outlier_share);
    CHECK(std::abs(found->offset_s) < 60e-6);
    CHECK(std::abs(found->offset_s) < 4 * found->offset_sigma_s);
    CHECK(found->offset_sigma_s < 100e-6);
    const Eigen::Vector3d off =
        rotation_of(found->camera_from_imu * scene.camera_from_imu.conjugate());
    CHECK(off.norm() < 5e-3);
}
