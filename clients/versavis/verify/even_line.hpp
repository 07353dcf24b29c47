// SPDX-License-Identifier: BSD-3-Clause
// How far each point lies from the line through the points beside it.
#pragma once

#include <cstdint>
#include <vector>

namespace versavis::client {

struct LinePoint {
    std::int64_t x = 0;
    std::int64_t y = 0;
};

/// ns of y from the line through the points around each point, which nothing but a majority of
/// outliers can bend (Theil-Sen). `x` grows. Of fewer than four points: 0.
std::vector<std::int64_t> off_line(const std::vector<LinePoint>& points);

/// Median of the amounts: what is usual. 0: there are none.
std::int64_t usual_amount(std::vector<std::int64_t> values);

}  // namespace versavis::client
