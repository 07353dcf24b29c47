// SPDX-License-Identifier: BSD-3-Clause
// The time offset between cameras and IMU that Kalibr found, as a value of the configuration.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recording/kalibr_yaml.hpp"
#include "recording/recording.hpp"
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

/// Of an IMU's first sample; `imu` may be empty if there is one IMU. Errors, with `where` as the
/// recording's name: no such IMU, or which of several is not said.
Expected<Duration> recorded_filter_delay(const Recording& recording, const std::string& imu,
                                         const std::string& where);

/// `taken_off`: from the items of the recording that was calibrated with. Error: no camera has a
/// shift.
Expected<TimeShift> time_shift(const std::vector<CalibratedCamera>& cameras,
                               const std::optional<Duration>& taken_off, const std::string& where);

std::string to_text(const TimeShift& shift, bool json);

}  // namespace versavis::client
