// SPDX-License-Identifier: BSD-3-Clause
// Holds what comes at a steady pace, samples or pulses, against the numbers and times before it.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/plausibility/implausibility.hpp"
#include "engine/plausibility/running_estimate.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// One of them, as in a message of the board.
struct Pulse {
    std::uint32_t number = 0;  ///< of all that were due, modulo 2^32
    BoardTime at;
};

/// The pulses that were believed: times follow from numbers.
class PulseHistory {
 public:
    /// `period`: from one pulse to the next, as far as it is known. Over lost pulses the pace may
    /// wander by one part in `wander_parts` of the time.
    PulseHistory(Duration period, Duration tolerance, std::int64_t wander_parts)
        : pace_(period, tolerance), wander_parts_(wander_parts) {}

    std::optional<Implausibility> doubt(const Pulse& pulse) const;
    /// The same if the pace does not wander.
    std::optional<Implausibility> doubt_at_pace(const Pulse& pulse) const;
    void learn(const Pulse& pulse);
    bool repeats(const Pulse& pulse) const {
        return newest_ && newest_->number == pulse.number && newest_->at == pulse.at;
    }
    void rebase() { newest_.reset(); }

 private:
    std::optional<Implausibility> doubt(const Pulse& pulse, Duration wander) const;

    RunningEstimate pace_;
    std::int64_t wander_parts_;
    std::optional<Pulse> newest_;
};

}  // namespace versavis::daemon
