// SPDX-License-Identifier: BSD-3-Clause
// How the rig moves: sums of sines, drawn from the scenario's seed, that IMU and cameras share.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "scenario.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

/// amplitude * sin(2 pi hz t + phase), t in seconds since the motion's zero.
struct Tone {
    double hz = 0;
    double amplitude = 0;
    double phase_rad = 0;
};

/// The body is the IMU, whose z points up at rest; the world's z points up.
class Motion {
 public:
    /// It nods: about x, by 0.2 rad at 0.5 Hz.
    explicit Motion(HostTime zero) : Motion(zero, {}, 0) {}
    Motion(HostTime zero, const MotionScenario& scenario, std::uint64_t seed);

    /// Vectors of the body, in the world: yaw about z, after pitch about y, after roll about x.
    Eigen::Matrix3d attitude(HostTime at) const;
    /// Roll, which is what nodding changes.
    double roll_rad(HostTime at) const;
    /// In the body.
    Eigen::Vector3d rate_rad_s(HostTime at) const;
    /// What an accelerometer shows, in the body: standing still, gravity points up.
    Eigen::Vector3d specific_force_m_s2(HostTime at) const;

    HostTime zero() const { return zero_; }
    const std::array<std::vector<Tone>, 3>& angles() const { return angles_; }
    const std::array<std::vector<Tone>, 3>& position() const { return position_; }

 private:
    double seconds(HostTime at) const { return static_cast<double>((at - zero_).ns) * 1e-9; }

    HostTime zero_;
    std::array<std::vector<Tone>, 3> angles_;    ///< roll, pitch, yaw; rad
    std::array<std::vector<Tone>, 3> position_;  ///< metres, in the world
};

}  // namespace versavis::rig
