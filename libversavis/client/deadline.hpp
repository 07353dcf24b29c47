// SPDX-License-Identifier: BSD-3-Clause
// The end of a wait, however long somebody wants to wait.
#pragma once

#include <algorithm>
#include <cstdint>

#include "versavis/time.hpp"

namespace versavis {

/// Now and `timeout`, or the end of time; now, if that is past.
inline HostTime deadline_after(Duration timeout) {
    HostTime deadline;
    const bool endless =
        __builtin_add_overflow(host_now().ns, std::max(timeout, Duration{}).ns, &deadline.ns);
    return endless ? HostTime{INT64_MAX} : deadline;
}

/// What is left until then; nothing, when it has come.
inline Duration left_until(HostTime deadline) {
    return std::max(deadline - host_now(), Duration{});
}

inline bool is_over(HostTime deadline) { return left_until(deadline) == Duration{}; }

}  // namespace versavis
