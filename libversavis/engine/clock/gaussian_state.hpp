// SPDX-License-Identifier: BSD-3-Clause
// The estimated state of two clocks and the link between them, as a Gaussian, and how it ages.
#pragma once

#include <array>

#include "versavis/time.hpp"

namespace versavis::clock {

/// Components: 0 offset of the host's clock against the board's (ns), 1 skew (ns/s), 2 drift of the
/// skew (ns/s^2), 3 shortest delay of a message, taken to be the same both ways (ns).
struct GaussianState {
    std::array<double, 4> mean{};
    /// Column by column; gaussian_state_matrix.hpp calculates.
    std::array<double, 16> covariance{};

    /// After one exchange with this round trip in ns, whose midpoint is the zero of the offset.
    static GaussianState after_exchange(double round_trip_ns);

    /// As it is `span` later: two crystals whose skew walks at random and drifts as temperature
    /// does.
    GaussianState after(Duration span) const;

    /// The offset `span` later, and its variance; also for instants shortly before.
    double offset_after(Duration span) const;
    double offset_variance_after(Duration span) const;
};

}  // namespace versavis::clock
