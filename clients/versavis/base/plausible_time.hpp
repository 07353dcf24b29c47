// SPDX-License-Identifier: BSD-3-Clause
// Which times of a file are believed to be times.
#pragma once

#include <cstdint>

namespace versavis::client {

/// Within 73 years of zero, which leaves room for differences of differences.
inline bool is_plausible(std::int64_t ns) {
    constexpr std::int64_t most = std::int64_t{1} << 61;
    return ns > -most && ns < most;
}

}  // namespace versavis::client
