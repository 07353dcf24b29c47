// SPDX-License-Identifier: BSD-3-Clause
// A GaussianState as vector and matrix; separate, because few need Eigen, which compiles slowly.
#pragma once

#include <Eigen/Core>

#include "engine/clock/gaussian_state.hpp"

namespace versavis::clock {

using StateVector = Eigen::Vector4d;
using StateMatrix = Eigen::Matrix4d;

inline Eigen::Map<StateVector> vector(GaussianState& state) {
    return Eigen::Map<StateVector>(state.mean.data());
}
inline Eigen::Map<const StateVector> vector(const GaussianState& state) {
    return Eigen::Map<const StateVector>(state.mean.data());
}
inline Eigen::Map<StateMatrix> matrix(GaussianState& state) {
    return Eigen::Map<StateMatrix>(state.covariance.data());
}
inline Eigen::Map<const StateMatrix> matrix(const GaussianState& state) {
    return Eigen::Map<const StateMatrix>(state.covariance.data());
}

/// How the level of one direction's delays depends on the components `span` from now; `sign` is
/// that of DelayEdge.
StateVector level_by_component(double sign, Duration span);

/// How a state turns into that of `span` later, but for what is added by process_noise().
StateMatrix transition(Duration span);
StateMatrix process_noise(Duration span);

}  // namespace versavis::clock
