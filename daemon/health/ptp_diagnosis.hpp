// SPDX-License-Identifier: BSD-3-Clause
// What is wrong with a camera that is triggered at instants of PTP time.
#pragma once

#include <string>

#include "diagnosis.hpp"

namespace versavis::daemon {

struct PtpFinding {
    Fault fault = Fault::none;
    std::string hint;
};

/// The first cause in the order of cause; none for other cameras.
PtpFinding diagnose_ptp(const CameraStatus& camera, const Status& all);

}  // namespace versavis::daemon
