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

std::int64_t past_nearest_second_ns(std::int64_t ns) {
    constexpr std::int64_t second_ns = 1'000'000'000;
    const std::int64_t past = ns % second_ns;  // of the sign of `ns`
    if (past >= second_ns / 2) return past - second_ns;
    return past < -second_ns / 2 ? past + second_ns : past;
}

}  // namespace versavis
