// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/time.hpp"

#include <ctime>

namespace versavis {

HostTime host_now() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return {std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec};
}

}  // namespace versavis
