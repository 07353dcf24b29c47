// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace versavis::clock {

inline double square(double x) { return x * x; }

}  // namespace versavis::clock
