// SPDX-License-Identifier: BSD-3-Clause
// What is believed of two clocks and the link between them, as a Gaussian, and how it ages.
#pragma once

#include <array>

#include "versavis/time.hpp"

namespace versavis::clock {

/// Components: 0 offset of the host's clock against the board's (ns), 1 skew (ns/s), 2 drift of the
/// skew (ns/s^2), 3 shortest delay of a message, taken to be the same both ways (ns).
struct Belief {
    std::array<double, 4> mean{};
    std::array<double, 16> covariance{};  ///< column by column; belief_matrix.hpp calculates

    /// After one exchange with a round trip of so many ns, whose midpoint is the zero of the
    /// offset.
    static Belief after_exchange(double round_trip_ns);

    /// As it is `span` later: two crystals whose skew walks at random and drifts as temperature
    /// does.
    Belief after(Duration span) const;

    /// The offset `span` later, and its variance; also for instants shortly before.
    double offset_after(Duration span) const;
    double offset_variance_after(Duration span) const;
};

}  // namespace versavis::clock
