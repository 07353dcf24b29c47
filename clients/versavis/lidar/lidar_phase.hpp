// SPDX-License-Identifier: BSD-3-Clause
// When a camera must expose to see what a rotating LiDAR looks at.
#pragma once

#include "versavis/error.hpp"

namespace versavis::client {

/// Angles in degrees, as the LiDAR's packets have them.
struct LidarRotation {
    double lock_azimuth = 0;  ///< where it looks at each whole second
    unsigned rate_hz = 10;    ///< turns per second: whole, so that each second begins alike
    bool counterclockwise = false;
};

struct LidarPhase {
    double phase_us = 0;  ///< of the camera's grid: from 0 to its period
    unsigned frames_per_turn = 1;
};

/// `camera_rate_hz` 0: one frame per turn. Errors: the camera's frames are not at the same
/// azimuths in each turn, nor is there one in each of some turns.
Expected<LidarPhase> lidar_phase(const LidarRotation& rotation, double azimuth,
                                 double camera_rate_hz);

}  // namespace versavis::client
