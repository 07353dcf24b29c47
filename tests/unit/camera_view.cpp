// SPDX-License-Identifier: BSD-3-Clause
#include "camera_view.hpp"

#include <catch2/catch.hpp>
#include <numeric>

using namespace versavis;
using rig::CameraScenario;
using rig::CameraView;
using rig::Pinhole;
using rig::Scenario;
using rig::Surroundings;

namespace {

const HostTime view_begin{1'000'000'000};

Scenario scenario_of(const CameraScenario& camera, bool moving, bool leds) {
    Scenario scenario;
    scenario.motion.nods = !moving;
    scenario.leds.present = leds;
    scenario.cameras = {camera};
    return scenario;
}

CameraScenario small() {
    CameraScenario camera;
    camera.width = 160;
    camera.height = 120;
    return camera;
}

std::vector<std::uint8_t> picture(const Scenario& scenario, const Surroundings& surroundings,
                                  HostTime start, Duration exposure, std::uint64_t serial = 1) {
    const CameraView view(scenario, scenario.cameras[0], surroundings);
    std::vector<std::uint8_t> out(std::size_t{160} * 120);
    view.paint(start, start + exposure, serial, out);
    return out;
}

double difference(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
    return sum / static_cast<double>(a.size());
}

}  // namespace

TEST_CASE("camera_view: the wall is not painted, unless something is to be seen before it") {
    CameraScenario camera = small();
    const Scenario plain = scenario_of(camera, false, false);
    const Surroundings surroundings(view_begin, plain);
    CHECK_FALSE(CameraView(plain, camera, surroundings).painted());
    camera.noise = 2;
    CHECK(CameraView(plain, camera, surroundings).painted());
}

TEST_CASE("camera_view: a camera that is turned against the IMU sees the world as the IMU does") {
    CameraScenario camera = small();
    camera.imu_rotation_deg = {0, 90, 0};  // ahead, z, is x of the IMU turned about y
    camera.blur_steps = 1;
    const Scenario scenario = scenario_of(camera, true, false);
    const Surroundings surroundings(view_begin, scenario);
    const auto seen = picture(scenario, surroundings, view_begin, microseconds(2));
    const Pinhole pinhole = CameraView(scenario, camera, surroundings).pinhole();
    double sum = 0;
    for (std::uint32_t y = 0; y < 120; ++y)
        for (std::uint32_t x = 0; x < 160; ++x) {
            const Eigen::Vector3d ray = pinhole.ray(x, y);
            const Eigen::Vector3d in_imu(-ray.z(), ray.y(), ray.x());
            const Eigen::Vector3d in_world =
                surroundings.motion.attitude(view_begin + microseconds(1)) * in_imu;
            sum +=
                std::abs(seen[std::size_t{y} * 160 + x] - surroundings.world->brightness(in_world));
        }
    CHECK(sum / (160 * 120) < 2);
}

TEST_CASE("camera_view: motion blurs over the exposure, about its middle") {
    CameraScenario camera = small();
    Scenario scenario = scenario_of(camera, true, false);
    scenario.motion.rate_rad_s = {3, 3, 3};
    scenario.cameras[0].blur_steps = 16;
    const Surroundings surroundings(view_begin, scenario);
    const HostTime middle = view_begin + seconds(1);
    const auto blurred =
        picture(scenario, surroundings, middle - milliseconds(10), milliseconds(20));
    const auto sharp = [&](Duration off) {
        return picture(scenario, surroundings, middle + off, microseconds(1));
    };
    CHECK(difference(blurred, sharp(milliseconds(0))) > 2);
    CHECK(difference(blurred, sharp(milliseconds(0))) <
          difference(blurred, sharp(milliseconds(-6))));
    CHECK(difference(blurred, sharp(milliseconds(0))) <
          difference(blurred, sharp(milliseconds(6))));
}

TEST_CASE("camera_view: LEDs are where the scenario says, as bright as they were long on") {
    CameraScenario camera = small();
    camera.leds = {20, 60, 137, 80};
    const Scenario scenario = scenario_of(camera, true, true);
    const Surroundings surroundings(view_begin, scenario);
    surroundings.leds->pulse(view_begin + microseconds(250));
    surroundings.leds->settle(view_begin + seconds(1));
    const auto seen = picture(scenario, surroundings, view_begin, milliseconds(1));
    const auto at = [&](double led) {
        return int{seen[static_cast<std::size_t>(60.5 + 20 * led / 9) * 160 +
                        static_cast<std::size_t>(20.5 + 13 * led)]};
    };
    CHECK(at(0) == 160);
    CHECK(at(9) == 160);
    CHECK(at(1) == 20 + 140 / 4);
    CHECK(at(2) == 20 + 140 * 3 / 4);
    for (const double dark : {0.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.5}) CHECK(at(dark) == 20);
}

TEST_CASE(
    "camera_view: brightness follows the exposure, and noise is as strong as it is configured") {
    CameraScenario camera = small();
    Scenario scenario = scenario_of(camera, true, false);
    const Surroundings surroundings(view_begin, scenario);
    const auto mean = [](const auto& image) {
        return std::accumulate(image.begin(), image.end(), 0.0) / static_cast<double>(image.size());
    };
    const auto plain = picture(scenario, surroundings, view_begin, milliseconds(2));
    scenario.cameras[0].light = 0.25;
    CHECK(mean(picture(scenario, surroundings, view_begin, milliseconds(2))) ==
          Approx(mean(plain) / 2).margin(1));
    scenario.cameras[0].light = 0;
    scenario.cameras[0].noise = 5;
    const auto noisy = picture(scenario, surroundings, view_begin, milliseconds(2));
    double squares = 0;
    for (std::size_t i = 0; i < plain.size(); ++i)
        squares += std::pow(int{noisy[i]} - int{plain[i]}, 2);
    CHECK(std::sqrt(squares / static_cast<double>(plain.size())) == Approx(5).margin(0.3));
    CHECK(noisy == picture(scenario, surroundings, view_begin, milliseconds(2)));
    CHECK(noisy != picture(scenario, surroundings, view_begin, milliseconds(2), 2));
}
