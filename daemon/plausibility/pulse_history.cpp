// SPDX-License-Identifier: BSD-3-Clause
#include "pulse_history.hpp"

#include <algorithm>

namespace versavis::daemon {

std::optional<Implausibility> PulseHistory::doubt(const Pulse& pulse) const {
    return doubt(pulse, pace_.value() / wander_parts_ + pace_.uncertainty());
}

std::optional<Implausibility> PulseHistory::doubt_at_pace(const Pulse& pulse) const {
    return doubt(pulse, {});
}

/// `wander`: of the pace, at each pulse that is not known.
std::optional<Implausibility> PulseHistory::doubt(const Pulse& pulse, Duration wander) const {
    if (!newest_) return std::nullopt;
    const auto pulses = static_cast<std::int32_t>(pulse.number - newest_->number);
    if (pulses <= 0)
        return Implausibility{EventReason::implausible_number, pulse.number, newest_->number + 1};
    const Duration off = pulse.at - newest_->at - pace_.value() * pulses;
    // Further off it might as well be the pulse beside that.
    const Duration furthest = pace_.value() / 2;
    if (absolute(off) <= std::min(pace_.tolerance() + wander * (pulses - 1), furthest))
        return std::nullopt;
    return Implausibility{EventReason::implausible_time, pulse.at.ns, (pulse.at - off).ns};
}

void PulseHistory::learn(const Pulse& pulse) {
    if (newest_)
        pace_.learn((pulse.at - newest_->at) /
                    static_cast<std::int32_t>(pulse.number - newest_->number));
    newest_ = pulse;
}

}  // namespace versavis::daemon
