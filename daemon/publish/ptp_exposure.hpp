// SPDX-License-Identifier: BSD-3-Clause
// An exposure of a camera whose clock follows PTP, by the camera's own account.
#pragma once

#include <cstdint>

#include "versavis/time.hpp"

namespace versavis::daemon {

struct PtpExposure {
    std::uint64_t trigger = 0;
    std::uint64_t tick = 0;
    CameraTime start;
    Duration length;
    Duration start_delay;       ///< trigger to start, beyond the configured latency
    Duration middle_sigma;      ///< for what is not known of instant and length ...
    Duration start_sigma;       ///< ... and the same of the start
    bool length_known = false;  ///< else it is the expected one

    CameraTime middle() const { return start + length / 2; }
};

}  // namespace versavis::daemon
