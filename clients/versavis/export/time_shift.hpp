// SPDX-License-Identifier: BSD-3-Clause
// The time offset between cameras and IMU that Kalibr found, as a value of the configuration.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "export/kalibr_yaml.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

struct CameraShift {
    std::string camera;
    double shift_s;  ///< t_imu = t_cam + it
};

struct TimeShift {
    std::vector<CameraShift> cameras;
    Duration taken_off;  ///< the IMU's filter delay that the recorded stamps are without
    bool known = false;  ///< taken_off is of a recording
    double total_s = 0;  ///< of the IMU after the first camera: filter and all else
};

/// `taken_off`: from the items of the recording that was calibrated with. Error: no camera has a
/// shift.
Expected<TimeShift> time_shift(const std::vector<CalibratedCamera>& cameras,
                               const std::optional<Duration>& taken_off, const std::string& where);

std::string to_text(const TimeShift& shift, bool json);

}  // namespace versavis::client
