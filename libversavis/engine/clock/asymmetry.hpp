// SPDX-License-Identifier: BSD-3-Clause
// What a link does unequally to its two directions, which no stamp of a message shows.
#pragma once

#include <optional>

#include "versavis/time.hpp"

namespace versavis::clock {

struct Asymmetry {
    Duration offset;  ///< half of what the shortest delay to the host is longer than the one to the
                      ///< board
    Duration sigma;
};

/// Variance of the host time by the asymmetry, in ns^2: as measured, or else an allowance by the
/// shortest delay of a message, and no less than an estimate of it may be wrong by.
double asymmetry_variance(const std::optional<Asymmetry>& measured, double shortest_delay_ns,
                          double doubt_ns = 0);

}  // namespace versavis::clock
