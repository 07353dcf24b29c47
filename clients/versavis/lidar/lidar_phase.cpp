// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/lidar_phase.hpp"

#include <fmt/format.h>

#include <cmath>

namespace versavis::client {

namespace {

/// Of a rate, so that 29.97 Hz is not taken for 30.
constexpr double whole_tolerance = 1e-6;

bool is_whole(double number) { return std::abs(number - std::round(number)) < whole_tolerance; }

}  // namespace

Expected<LidarPhase> lidar_phase(const LidarRotation& rotation, double azimuth,
                                 double camera_rate_hz) {
    if (!std::isfinite(azimuth) || !std::isfinite(rotation.lock_azimuth))
        return failure("the azimuth", "is no angle", "give degrees, as -90 or 359.5");
    const double turns_hz = rotation.rate_hz;
    const double rate_hz = camera_rate_hz == 0 ? turns_hz : camera_rate_hz;
    const bool more = rate_hz >= turns_hz;
    if (!is_whole(more ? rate_hz / turns_hz : turns_hz / rate_hz))
        return failure(
            fmt::format("{:g} frames and {} turns per second", rate_hz, rotation.rate_hz),
            "do not stay together",
            "choose a rate that is a multiple of the other, or a whole part of it");
    const double ahead = rotation.counterclockwise ? rotation.lock_azimuth - azimuth
                                                   : azimuth - rotation.lock_azimuth;
    const double turn = ahead / 360 - std::floor(ahead / 360);
    LidarPhase phase;
    phase.frames_per_turn = more ? static_cast<unsigned>(std::lround(rate_hz / turns_hz)) : 1;
    phase.phase_us = std::fmod(turn / turns_hz, 1 / rate_hz) * 1e6;
    return phase;
}

}  // namespace versavis::client
