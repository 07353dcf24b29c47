// SPDX-License-Identifier: BSD-3-Clause
// Noise of an IMU at rest by its Allan deviation: white noise and random walk, with their bounds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "evaluate/bias_history.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// The deviation at one averaging time.
struct AllanPoint {
    double tau_s = 0;
    double deviation = 0;       ///< in the unit of the rate
    double relative_sigma = 0;  ///< one standard deviation of it, as a share of it
};

/// Overlapping Allan deviation of rates that are `interval_s` apart, at averaging times of 1, 2, 4,
/// ... intervals, as long as three of them fit into the rates.
std::vector<AllanPoint> allan_deviation(std::span<const float> rates, double interval_s);

/// A value and one standard deviation of it.
struct Measured {
    double value = 0;
    double sigma = 0;
};

/// Of one axis. Units: u is rad/s of a gyro, m/s^2 of an accelerometer.
struct AxisNoise {
    Measured density;                ///< white noise, u / sqrt(Hz)
    std::optional<Measured> walk;    ///< of the bias, u / s / sqrt(Hz); none: not seen
    double walk_limit = 0;           ///< it is below this, at two standard deviations
    double walk_needs_s = 0;         ///< how long a recording shows it, if it is at the limit
    double flicker = 0;              ///< bias instability, u: the floor between both slopes
    double white_from_s = 0;         ///< averaging time from which on the noise is white
    std::optional<BiasDrift> drift;  ///< that was taken off before
    bool smooth = false;  ///< the bias changes as no random walk does, which is not known then
    std::vector<AllanPoint> points;  ///< without the drift
};

/// A drift of the bias is found and taken off (see bias_history()). Errors: too short for white
/// noise, or none is there.
Expected<AxisNoise> axis_noise(std::span<const float> rates, double interval_s);

/// What an IMU measured at rest.
struct RestingImu {
    std::string name;
    std::vector<OutputTime> times;
    std::array<std::vector<float>, 3> gyro;   ///< rad/s
    std::array<std::vector<float>, 3> accel;  ///< m/s^2
};

struct AllanResult {
    std::string name;
    double rate_hz = 0;
    double duration_s = 0;
    std::uint64_t missing = 0;  ///< samples that were filled in
    std::uint64_t spikes = 0;   ///< values that were replaced
    std::array<AxisNoise, 3> gyro;
    std::array<AxisNoise, 3> accel;
};

/// Errors: too short; too many samples missing, or spikes; it was moved, and when.
Expected<AllanResult> evaluate_allan(const RestingImu& imu);

/// Of the three axes together: the root of their mean square. None: not seen at each axis.
std::optional<Measured> walk_of(const std::array<AxisNoise, 3>& axes);
Measured density_of(const std::array<AxisNoise, 3>& axes);

/// The bias of an axis changes as no random walk does.
bool is_smooth(const AllanResult& result);

/// How long a recording would have to be to show all random walks.
double walk_needs_s(const AllanResult& result);

/// The file imu.yaml of Kalibr. Error: a random walk is not known; how long to record.
Expected<std::string> kalibr_imu_yaml(const AllanResult& result, const std::string& topic);

}  // namespace versavis::client
