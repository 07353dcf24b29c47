// SPDX-License-Identifier: BSD-3-Clause
// The samples of an IMU at rest as even series, without holes and single spikes.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "evaluate/allan.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct RestingSeries {
    double interval_s = 0;
    double duration_s = 0;
    std::uint64_t missing = 0;  ///< samples that were filled in
    std::uint64_t spikes = 0;   ///< values that were replaced by their neighbours'
    std::array<std::vector<float>, 3> gyro;
    std::array<std::vector<float>, 3> accel;
};

/// What is missing is filled with the scatter of the samples before it, along a straight line, so
/// that no deviation changes. Errors: too short; too many missing, or spikes; it was moved.
Expected<RestingSeries> resting_series(const RestingImu& imu);

}  // namespace versavis::client
