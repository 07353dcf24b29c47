// SPDX-License-Identifier: BSD-3-Clause
// What an estimator of the board's clock answers: host time, and how good it is.
#pragma once

#include "versavis/time.hpp"

namespace versavis::clock {

enum class ClockState {
    init,        ///< nothing is known
    converging,  ///< usable, but not yet as good as it will be
    locked,
    holdover,  ///< no message for seconds: sigma grows
    step,      ///< messages contradict the estimate: one of the clocks may have been stepped
    reset,     ///< the board began a new life, and nothing is known of it yet
};
const char* to_string(ClockState state);

/// Standard deviations that a bound allows for besides the round trip: one of 1000 exceeds them.
/// Half: one of ten does. Twice: the bound is loose where sigma is large, as in holdover.
constexpr double bound_sigmas = 3.3;

struct HostEstimate {
    HostTime time;
    Duration sigma;   ///< one standard deviation, if the shortest delays of both directions are
                      ///< nearly equal
    Duration bound;   ///< what the error cannot exceed, however unequal they are, but for 1 in 1000
    Duration spread;  ///< the part of sigma that differences of two delays have, too
    ClockState state = ClockState::init;
};

}  // namespace versavis::clock
