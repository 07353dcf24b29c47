// SPDX-License-Identifier: BSD-3-Clause
// Orientation and rate of a gyro at any instant, between its samples, too.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

struct GyroSample {
    OutputTime time;
    Eigen::Vector3d rate;  ///< rad/s
};

/// Rotation by this angle and axis, and back.
Eigen::Quaterniond rotation_by(const Eigen::Vector3d& rotation);
Eigen::Vector3d rotation_of(const Eigen::Quaterniond& orientation);

/// Between samples the rate lies on a straight line.
class GyroTrack {
 public:
    /// The samples' times must grow, and there must be two at least.
    GyroTrack(const std::vector<GyroSample>& samples, const Eigen::Vector3d& bias);

    /// `s`: seconds since the first sample. Orientation against that at the first sample: turns
    /// what is seen in the gyro's axes into the axes that it had then.
    Eigen::Quaterniond orientation(double s) const;
    Eigen::Vector3d rate(double s) const;
    double end_s() const { return times_.back(); }

 private:
    std::size_t sample_before(double s) const;

    std::vector<double> times_;
    std::vector<Eigen::Vector3d> rates_;
    std::vector<Eigen::Quaterniond> orientations_;
};

}  // namespace versavis::client
