// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/asymmetry.hpp"

#include <algorithm>

#include "engine/clock/square.hpp"

namespace versavis::clock {

namespace {

// Allowance for unequal directions, as a share of the shortest delay. Half or twice: sigma of
// slow links changes by little, as their jitter is larger.
constexpr double share = 0.04;

// A further share for short delays: some instructions more or less. Half: NEES over USB leaves
// its range. Twice: sigma is too large there.
constexpr double share_of_short = 0.08;

// The most of that further share. Half: as above for links of more than 20 us. Twice: sigma of
// delays of 50 us is a fifth larger.
constexpr double most_of_short_ns = 3000.0;

}  // namespace

double asymmetry_variance(const std::optional<Asymmetry>& measured, double shortest_delay_ns,
                          double doubt_ns) {
    if (measured) return square(static_cast<double>(measured->sigma.ns));
    const double of_short = std::min(share_of_short * shortest_delay_ns, most_of_short_ns);
    return square(share * shortest_delay_ns) + square(std::max(of_short, doubt_ns));
}

}  // namespace versavis::clock
