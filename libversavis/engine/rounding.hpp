// SPDX-License-Identifier: BSD-3-Clause
// From real numbers to integer nanoseconds, and to the nearest second.
#pragma once

#include "versavis/time.hpp"

namespace versavis {

/// The nearest whole number of nanoseconds, cut at 36 years either way; NaN gives the lower limit.
Duration rounded(double ns);

/// How far `ns` lies past the nearest multiple of a second: from minus half a second up to, but not
/// including, plus half a second.
std::int64_t past_nearest_second_ns(std::int64_t ns);

}  // namespace versavis
