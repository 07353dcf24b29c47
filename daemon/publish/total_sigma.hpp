// SPDX-License-Identifier: BSD-3-Clause
// Sigma of a stamp: that of the clock, and what else is uncertain, which has nothing to do with it.
#pragma once

#include <algorithm>
#include <cmath>

#include "versavis/metadata.hpp"

namespace versavis::daemon {

inline std::uint32_t total_sigma_ns(std::uint32_t clock_ns, Duration other) {
    const double sigma = std::hypot(static_cast<double>(clock_ns), static_cast<double>(other.ns));
    return static_cast<std::uint32_t>(std::min<double>(sigma, sigma_unknown - 1));
}

}  // namespace versavis::daemon
