// SPDX-License-Identifier: BSD-3-Clause
// Which of a camera's features hold the state of its sensor.
#pragma once

#include <string>

namespace versavis::daemon {

/// Empty: the camera has none.
struct SensorFeatures {
    std::string gain;
    std::string temperature;  ///< in degrees Celsius
};

}  // namespace versavis::daemon
