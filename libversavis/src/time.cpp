// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/time.hpp"

#include <cmath>
#include <ctime>

namespace versavis {

Duration rounded(double ns) {
    constexpr double limit = 0x1p60;
    return {std::llround(std::fmin(std::fmax(ns, -limit), limit))};  // these take no notice of a NaN
}

HostTime host_now() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return {std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec};
}

}  // namespace versavis
