// SPDX-License-Identifier: BSD-3-Clause
#include "engine/rounding.hpp"

#include <cmath>

namespace versavis {

Duration rounded(double ns) {
    // 36 years. Half of it is still longer than any board runs; at twice, a sum of four overflows.
    constexpr std::int64_t limit = std::int64_t{1} << 60;
    if (!(ns > -limit)) return {-limit};  // a NaN, too
    return {ns < limit ? std::llround(ns) : limit};
}

}  // namespace versavis
