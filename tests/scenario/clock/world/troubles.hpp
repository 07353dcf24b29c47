// SPDX-License-Identifier: BSD-3-Clause
// Worlds in which several things go wrong one after the other, drawn by seed, and whether they are
// survived.
#pragma once

#include "score.hpp"

namespace versavis::clock_world {

/// Any link, with load, losses, silence, a reset, steps, slews or a suspended host between 60 and
/// 300 s. It ends two minutes later, or seven if there is one exchange a second with 10 ms of
/// jitter.
Settings troubled(std::uint64_t seed);

/// Of 120 instants of the last minute those at which the error is beyond its bound, six times
/// sigma, or what the link can ever cause. All: locked out.
template <class Estimator>
unsigned instants_off(const World& world, Observer<Estimator>& observer) {
    unsigned count = 0;
    const TrueTime end{world.settings().length.ns};
    for (TrueTime t = end - seconds(60); t < end; t = t + milliseconds(500)) {
        const clock::HostEstimate estimate = observer.estimate(t);
        const Duration error = absolute(estimate.time - world.host(t));
        const Duration tolerated =
            world.settings().exchange_hz < 5 ? milliseconds(2) : microseconds(150);
        if (error > estimate.bound || error > estimate.sigma * 6 || error > tolerated) ++count;
    }
    return count;
}

}  // namespace versavis::clock_world
