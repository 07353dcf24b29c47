// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/asymmetry.hpp"

#include <algorithm>

namespace versavis::clock {

namespace {

// A share of the delay, and some instructions more or less on short ones.
constexpr double share = 0.04;
constexpr double share_of_short = 0.08;
constexpr double most_of_short_ns = 3000;

double square(double x) { return x * x; }

}  // namespace

double asymmetry_variance(const std::optional<Asymmetry>& measured, double shortest_delay_ns) {
    if (measured) return square(static_cast<double>(measured->sigma.ns));
    return square(share * shortest_delay_ns) +
           square(std::min(share_of_short * shortest_delay_ns, most_of_short_ns));
}

}  // namespace versavis::clock
