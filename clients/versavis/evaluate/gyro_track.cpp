// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/gyro_track.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::client {

namespace {

/// Rotation by a rate that goes from `begin` to `end` on a straight line within `s`; the second
/// term is that of Magnus (1954), and what is left is of fifth order.
Eigen::Quaterniond turned(const Eigen::Vector3d& begin, const Eigen::Vector3d& end, double s) {
    return rotation_by((begin + end) * (s / 2) + begin.cross(end) * (s * s / 12));
}

}  // namespace

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& rotation) {
    const double angle = rotation.norm();
    // Below, sin(x)/x and 1 - x^2/6 differ by less than a double shows.
    const double share = angle < 1e-4 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
    Eigen::Quaterniond result(std::cos(angle / 2), 0, 0, 0);
    result.vec() = rotation * share;
    return result;
}

Eigen::Vector3d rotation_of(const Eigen::Quaterniond& orientation) {
    const double sine = orientation.vec().norm();
    if (sine < 1e-9) return 2 * orientation.vec() * (orientation.w() < 0 ? -1 : 1);
    double angle = 2 * std::atan2(sine, orientation.w());
    if (angle > M_PI) angle -= 2 * M_PI;
    return orientation.vec() * (angle / sine);
}

GyroTrack::GyroTrack(const std::vector<GyroSample>& samples, const Eigen::Vector3d& bias) {
    times_.reserve(samples.size());
    rates_.reserve(samples.size());
    orientations_.reserve(samples.size());
    for (const GyroSample& sample : samples) {
        times_.push_back(static_cast<double>((sample.time - samples.front().time).ns) * 1e-9);
        rates_.emplace_back(sample.rate - bias);
        if (orientations_.empty()) {
            orientations_.push_back(Eigen::Quaterniond::Identity());
            continue;
        }
        const std::size_t i = rates_.size() - 1;
        orientations_.push_back(
            (orientations_[i - 1] * turned(rates_[i - 1], rates_[i], times_[i] - times_[i - 1]))
                .normalized());
    }
}

std::size_t GyroTrack::sample_before(double s) const {
    const auto after = std::upper_bound(times_.begin(), times_.end(), s);
    const auto index = after == times_.begin() ? 0 : after - times_.begin() - 1;
    return std::min(static_cast<std::size_t>(index), times_.size() - 2);
}

Eigen::Vector3d GyroTrack::rate(double s) const {
    const std::size_t i = sample_before(s);
    const double share = (s - times_[i]) / (times_[i + 1] - times_[i]);
    return rates_[i] + (rates_[i + 1] - rates_[i]) * share;
}

Eigen::Quaterniond GyroTrack::orientation(double s) const {
    const std::size_t i = sample_before(s);
    const double since = s - times_[i];
    const double share = since / (times_[i + 1] - times_[i]);
    return orientations_[i] *
           turned(rates_[i], rates_[i] + (rates_[i + 1] - rates_[i]) * share, since);
}

}  // namespace versavis::client
