// SPDX-License-Identifier: BSD-3-Clause
// The end of a wait, however long somebody wants to wait.
#pragma once

#include <cstdint>

#include "versavis/time.hpp"

namespace versavis {

/// Now and `timeout`, or the end of time; now, if that is past.
inline HostTime deadline_after(Duration timeout) {
    const HostTime now = host_now();
    if (timeout.ns <= 0) return now;
    const bool endless = timeout.ns > INT64_MAX - now.ns;
    return endless ? HostTime{INT64_MAX} : now + timeout;
}

}  // namespace versavis
