// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/time.hpp"

#include "client/clock_ns.hpp"

namespace versavis {

HostTime host_now() { return {clock_ns(CLOCK_MONOTONIC_RAW)}; }

}  // namespace versavis
