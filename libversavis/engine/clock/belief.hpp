// SPDX-License-Identifier: BSD-3-Clause
// What is believed of two clocks and the link between them, as a Gaussian, and how it ages.
#pragma once

#include <Eigen/Core>

#include "versavis/time.hpp"

namespace versavis::clock {

/// Components: 0 offset of the host's clock against the board's (ns), 1 skew (ns/s), 2 drift of the
/// skew (ns/s^2), 3 shortest delay of a message, taken to be the same both ways (ns).
struct Belief {
    using Vector = Eigen::Vector4d;
    using Matrix = Eigen::Matrix4d;

    Vector mean = Vector::Zero();
    Matrix covariance = Matrix::Zero();

    /// After one exchange with a round trip of so many ns, whose midpoint is the zero of the
    /// offset.
    static Belief after_exchange(double round_trip_ns);

    /// As it is `span` later: two crystals whose skew walks at random and drifts as temperature
    /// does.
    Belief after(Duration span) const;

    /// The offset `span` later, and its variance; also for instants shortly before.
    double offset_after(Duration span) const;
    double offset_variance_after(Duration span) const;

    /// How the level of one direction's delays depends on the components `span` from now; `sign` is
    /// that of DelayEdge.
    static Vector level_by_component(double sign, Duration span);
};

/// How a belief turns into that of `span` later, but for what is added by process_noise().
Belief::Matrix transition(Duration span);
Belief::Matrix process_noise(Duration span);

}  // namespace versavis::clock
