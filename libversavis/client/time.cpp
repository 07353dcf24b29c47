// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/time.hpp"

#include <cmath>
#include <ctime>

namespace versavis {

Duration rounded(double ns) {
    constexpr std::int64_t limit = std::int64_t{1} << 60;
    if (!(ns > -limit)) return {-limit};  // a NaN, too
    return {ns < limit ? std::llround(ns) : limit};
}

HostTime host_now() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return {std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec};
}

}  // namespace versavis
