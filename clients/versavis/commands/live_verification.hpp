// SPDX-License-Identifier: BSD-3-Clause
// `versavis verify --live`: whether the pictures of running cameras belong to their stamps.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "verify/verdict.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct LiveVerificationSettings {
    std::string instance;
    std::vector<std::string> cameras;  ///< empty: all
    std::string imu;                   ///< empty: the only one
    std::string calibration;           ///< file of Kalibr's
    double focal = 0;                  ///< pixels; 0: by the calibration
    double seconds = 0;                ///< 0: until it is stopped
    bool json = false;
    std::function<bool()> stop;  ///< asked between two frames
    std::function<void(const std::string& line, bool alarm)> say;
};

/// Reads until it is stopped, and says what changes, or with `json` each comparison. Returns the
/// worst that it saw: untrusted where pictures and stamps of a camera differed, plausible where a
/// camera could not be judged. What is not there yet is waited for. Errors: no calibration, or none
/// for these frames; several IMUs; pixels that cannot be read.
Expected<Grade> verify_live(const LiveVerificationSettings& settings);

}  // namespace versavis::client
