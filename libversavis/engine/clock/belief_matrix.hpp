// SPDX-License-Identifier: BSD-3-Clause
// A belief as vector and matrix. Apart from it, since few need Eigen, which takes long to compile.
#pragma once

#include <Eigen/Core>

#include "engine/clock/belief.hpp"

namespace versavis::clock {

using BeliefVector = Eigen::Vector4d;
using BeliefMatrix = Eigen::Matrix4d;

inline Eigen::Map<BeliefVector> vector(Belief& belief) {
    return Eigen::Map<BeliefVector>(belief.mean.data());
}
inline Eigen::Map<const BeliefVector> vector(const Belief& belief) {
    return Eigen::Map<const BeliefVector>(belief.mean.data());
}
inline Eigen::Map<BeliefMatrix> matrix(Belief& belief) {
    return Eigen::Map<BeliefMatrix>(belief.covariance.data());
}
inline Eigen::Map<const BeliefMatrix> matrix(const Belief& belief) {
    return Eigen::Map<const BeliefMatrix>(belief.covariance.data());
}

/// How the level of one direction's delays depends on the components `span` from now; `sign` is
/// that of DelayEdge.
BeliefVector level_by_component(double sign, Duration span);

/// How a belief turns into that of `span` later, but for what is added by process_noise().
BeliefMatrix transition(Duration span);
BeliefMatrix process_noise(Duration span);

}  // namespace versavis::clock
