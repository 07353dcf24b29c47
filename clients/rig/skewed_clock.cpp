// SPDX-License-Identifier: BSD-3-Clause
#include "skewed_clock.hpp"

#include <cmath>

namespace versavis::rig {

std::int64_t SkewedClock::device_ns(HostTime host) const {
    const std::int64_t elapsed = (host - zero_).ns;
    const double seconds = static_cast<double>(elapsed) * 1e-9;
    const double gained =
        errors_.skew_ppm * 1e3 * seconds + 0.5 * errors_.drift_ppm_per_s * 1e3 * seconds * seconds;
    return errors_.offset_ns + elapsed + std::llround(gained);
}

HostTime SkewedClock::host(std::int64_t device) const {
    HostTime guess = zero_ + Duration{device - errors_.offset_ns};
    for (int i = 0; i < 8; ++i)
        guess = guess + Duration{device - device_ns(guess)};  // contracts by the skew: 1e-3 at most
    return guess;
}

}  // namespace versavis::rig
