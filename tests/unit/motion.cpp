// SPDX-License-Identifier: BSD-3-Clause
#include "motion.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;
using rig::Motion;
using rig::MotionScenario;
using rig::Tone;

namespace {

const HostTime motion_begin{1'000'000'000};

MotionScenario wild() {
    MotionScenario scenario;
    scenario.nods = false;
    scenario.rate_rad_s = {0.3, 0.5, 0.7};
    scenario.acceleration_m_s2 = {0.5, 1, 2};
    return scenario;
}

/// Position, from the tones.
Eigen::Vector3d position(const Motion& motion, HostTime at) {
    Eigen::Vector3d sum(0, 0, 0);
    const double t = static_cast<double>((at - motion.zero()).ns) * 1e-9;
    for (std::size_t i = 0; i < 3; ++i)
        for (const Tone& tone : motion.position().at(i))
            sum[static_cast<Eigen::Index>(i)] +=
                tone.amplitude * std::sin(2 * 3.14159265358979 * tone.hz * t + tone.phase_rad);
    return sum;
}

}  // namespace

TEST_CASE("motion: the gyro shows how the attitude changes") {
    const Motion motion(motion_begin, wild(), 7);
    const Duration step = microseconds(100);
    for (int i = 0; i < 200; ++i) {
        const HostTime at = motion_begin + milliseconds(37) * i;
        const Eigen::Matrix3d turned =
            motion.attitude(at - step).transpose() * motion.attitude(at + step);
        const Eigen::AngleAxisd angle(turned);
        const Eigen::Vector3d rate =
            angle.axis() * angle.angle() / (2e-9 * static_cast<double>(step.ns));
        REQUIRE((rate - motion.rate_rad_s(at)).norm() < 1e-5);
    }
}

TEST_CASE("motion: the accelerometer shows gravity and how the position changes") {
    const Motion motion(motion_begin, wild(), 7);
    const Duration step = milliseconds(1);
    for (int i = 0; i < 200; ++i) {
        const HostTime at = motion_begin + milliseconds(37) * i;
        const Eigen::Vector3d acceleration =
            (position(motion, at + step) + position(motion, at - step) - 2 * position(motion, at)) /
            1e-6;
        const Eigen::Vector3d force =
            motion.attitude(at).transpose() * (acceleration + Eigen::Vector3d(0, 0, 9.80665));
        REQUIRE((force - motion.specific_force_m_s2(at)).norm() < 1e-3);
    }
}

TEST_CASE("motion: it is as strong as configured, within its band, and the seed draws it") {
    MotionScenario scenario = wild();
    scenario.lowest_hz = 0.5;
    scenario.highest_hz = 3;
    const Motion motion(motion_begin, scenario, 7);
    for (std::size_t i = 0; i < 3; ++i) {
        double squares = 0;
        for (const Tone& tone : motion.angles().at(i)) {
            CHECK(tone.hz >= 0.5);
            CHECK(tone.hz <= 3);
            squares += std::pow(tone.amplitude * 2 * 3.14159265358979 * tone.hz, 2) / 2;
        }
        CHECK(std::sqrt(squares) == Approx(scenario.rate_rad_s[i]));
    }
    const HostTime at = motion_begin + seconds(3);
    CHECK(motion.rate_rad_s(at) == Motion(motion_begin, scenario, 7).rate_rad_s(at));
    CHECK(motion.rate_rad_s(at) != Motion(motion_begin, scenario, 8).rate_rad_s(at));
}

TEST_CASE("motion: without a scenario it nods, and stands still on request") {
    const Motion nodding(motion_begin);
    CHECK(nodding.roll_rad(motion_begin + milliseconds(500)) == Approx(0.2));
    CHECK(nodding.rate_rad_s(motion_begin).x() == Approx(0.2 * 3.14159265358979));
    MotionScenario still = wild();
    still.rate_rad_s = still.acceleration_m_s2 = {0, 0, 0};
    const Motion none(motion_begin, still, 7);
    CHECK(none.rate_rad_s(motion_begin + seconds(1)).norm() == 0);
    CHECK(none.specific_force_m_s2(motion_begin + seconds(1)).z() == Approx(9.80665));
}
