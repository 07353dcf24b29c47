// SPDX-License-Identifier: BSD-3-Clause
// Worlds in which several things go wrong one after the other, drawn by seed, and whether they are survived.
#pragma once

#include "score.hpp"

namespace versavis::clock_world {

/// 420 s on any link, with load, losses, silence, a reset, steps, slews or a suspended host between 60 and
/// 300 s.
Settings troubled(std::uint64_t seed);

/// Instants from 360 s on, a minute after the last trouble, at which the error is beyond its bound, six times
/// sigma, or what the link can ever cause.
template <class Estimator>
unsigned lock_outs(const World& world, Observer<Estimator>& observer) {
    unsigned count = 0;
    for (TrueTime t{seconds(360).ns}; t < TrueTime{world.settings().length.ns}; t = t + milliseconds(500)) {
        const clock::HostEstimate estimate = observer.estimate(t);
        const Duration error = absolute(estimate.time - world.host(t));
        const Duration tolerated = world.settings().exchange_hz < 5 ? milliseconds(2) : microseconds(150);
        if (error > estimate.bound || error > estimate.sigma * 6 || error > tolerated) ++count;
    }
    return count;
}

}  // namespace versavis::clock_world
