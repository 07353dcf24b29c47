// SPDX-License-Identifier: BSD-3-Clause
#include "motion.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

namespace versavis::rig {

namespace {

constexpr double gravity_m_s2 = 9.80665;

double angular(const Tone& tone) { return 2 * std::numbers::pi * tone.hz; }
double phase(const Tone& tone, double t) { return angular(tone) * t + tone.phase_rad; }

double value(const std::vector<Tone>& tones, double t) {
    double sum = 0;
    for (const Tone& tone : tones) sum += tone.amplitude * std::sin(phase(tone, t));
    return sum;
}

double first_derivative(const std::vector<Tone>& tones, double t) {
    double sum = 0;
    for (const Tone& tone : tones) sum += tone.amplitude * angular(tone) * std::cos(phase(tone, t));
    return sum;
}

double second_derivative(const std::vector<Tone>& tones, double t) {
    double sum = 0;
    for (const Tone& tone : tones)
        sum -= tone.amplitude * angular(tone) * angular(tone) * std::sin(phase(tone, t));
    return sum;
}

/// From 0 to below 1, the same with each standard library.
double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11U) * 0x1p-53; }

/// Tones spread over the band, whose derivative of the order given has the RMS given in all.
std::vector<Tone> draw(const MotionScenario& scenario, double rms, int derivative,
                       std::mt19937_64& random) {
    std::vector<Tone> tones;
    const double step = (scenario.highest_hz - scenario.lowest_hz) / scenario.tones;
    for (unsigned i = 0; i < scenario.tones; ++i) {
        Tone tone;
        tone.hz = scenario.lowest_hz + step * (i + uniform(random));
        tone.phase_rad = 2 * std::numbers::pi * uniform(random);
        tone.amplitude =
            rms * std::sqrt(2.0 / scenario.tones) / std::pow(angular(tone), derivative);
        if (rms > 0) tones.push_back(tone);
    }
    return tones;
}

}  // namespace

Motion::Motion(HostTime zero, const MotionScenario& scenario, std::uint64_t seed) : zero_(zero) {
    if (scenario.nods) {
        angles_[0] = {{0.5, 0.2, 0}};
        return;
    }
    std::mt19937_64 random(seed);
    for (std::size_t i = 0; i < 3; ++i)
        angles_.at(i) = draw(scenario, scenario.rate_rad_s[i], 1, random);
    for (std::size_t i = 0; i < 3; ++i)
        position_.at(i) = draw(scenario, scenario.acceleration_m_s2[i], 2, random);
}

Eigen::Matrix3d Motion::attitude(HostTime at) const {
    using Eigen::AngleAxisd;
    using Eigen::Vector3d;
    const double t = seconds(at);
    return (AngleAxisd(value(angles_[2], t), Vector3d::UnitZ()) *
            AngleAxisd(value(angles_[1], t), Vector3d::UnitY()) *
            AngleAxisd(value(angles_[0], t), Vector3d::UnitX()))
        .toRotationMatrix();
}

double Motion::roll_rad(HostTime at) const { return value(angles_[0], seconds(at)); }

Eigen::Vector3d Motion::rate_rad_s(HostTime at) const {
    const double t = seconds(at);
    const double roll = value(angles_[0], t);
    const double pitch = value(angles_[1], t);
    const double roll_rate = first_derivative(angles_[0], t);
    const double pitch_rate = first_derivative(angles_[1], t);
    const double yaw_rate = first_derivative(angles_[2], t);
    return {roll_rate - yaw_rate * std::sin(pitch),
            pitch_rate * std::cos(roll) + yaw_rate * std::cos(pitch) * std::sin(roll),
            yaw_rate * std::cos(pitch) * std::cos(roll) - pitch_rate * std::sin(roll)};
}

Eigen::Vector3d Motion::specific_force_m_s2(HostTime at) const {
    const double t = seconds(at);
    const Eigen::Vector3d in_world(second_derivative(position_[0], t),
                                   second_derivative(position_[1], t),
                                   second_derivative(position_[2], t) + gravity_m_s2);
    return attitude(at).transpose() * in_world;
}

}  // namespace versavis::rig
