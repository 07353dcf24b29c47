// SPDX-License-Identifier: BSD-3-Clause
// What is believed of two clocks and the link between them, as a Gaussian, and how it ages.
#pragma once

#include <Eigen/Core>

namespace versavis::clock {

/// Components: 0 offset of the host's clock against the board's (ns), 1 skew (ns/s), 2 drift of the skew
/// (ns/s^2), 3 shortest delay of a message, taken to be the same both ways (ns).
struct Belief {
    using Vector = Eigen::Vector4d;
    using Matrix = Eigen::Matrix4d;

    Vector mean = Vector::Zero();
    Matrix covariance = Matrix::Zero();

    /// After one exchange with a round trip of so many ns, whose midpoint is the zero of the offset.
    static Belief after_exchange(double round_trip_ns);

    /// As it is `seconds` later: two crystals whose skew walks at random and drifts as temperature does.
    Belief after(double seconds) const;

    /// The offset `seconds` later, and its variance; also for instants shortly before.
    double offset_after(double seconds) const {
        return mean[0] + seconds * (mean[1] + 0.5 * seconds * mean[2]);
    }
    double offset_variance_after(double seconds) const;

    /// How the level of one direction's delays depends on the components `seconds` from now; `sign` is that
    /// of DelayEdge.
    static Vector level_by_component(double sign, double seconds) {
        return {sign, sign * seconds, sign * 0.5 * seconds * seconds, 1};
    }
};

/// How a belief turns into that of `seconds` later, but for what is added by process_noise().
Belief::Matrix transition(double seconds);
Belief::Matrix process_noise(double seconds);

}  // namespace versavis::clock
