// SPDX-License-Identifier: BSD-3-Clause
// A device's clock as a function of true host time: offset, skew and linear drift, exactly
// invertible.
#pragma once

#include <cstdint>

#include "versavis/time.hpp"

namespace versavis::rig {

struct ClockErrors {
    std::int64_t offset_ns = 0;  ///< device time at `zero`
    double skew_ppm = 0;
    double drift_ppm_per_s = 0;
};

class SkewedClock {
 public:
    SkewedClock(HostTime zero, const ClockErrors& errors) : zero_(zero), errors_(errors) {}

    /// Device time at `host`.
    std::int64_t device_ns(HostTime host) const;

    /// Host time at which the clock shows `device_ns`; inverse of device_ns() within 1 ns.
    HostTime host(std::int64_t device_ns) const;

 private:
    HostTime zero_;
    ClockErrors errors_;
};

}  // namespace versavis::rig
