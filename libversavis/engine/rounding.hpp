// SPDX-License-Identifier: BSD-3-Clause
// From the estimators' real numbers back to integer nanoseconds.
#pragma once

#include "versavis/time.hpp"

namespace versavis {

/// The nearest whole number of nanoseconds, cut at 36 years either way; NaN gives the lower limit.
Duration rounded(double ns);

}  // namespace versavis
