// SPDX-License-Identifier: BSD-3-Clause
// Holds the events of the board against the host's time, and PPS against the pulses before.
#pragma once

#include <optional>

#include "engine/clock/translator.hpp"
#include "engine/plausibility/implausibility.hpp"
#include "engine/plausibility/majority_filter.hpp"
#include "pulse_history.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class EventValidator {
 public:
    explicit EventValidator(const clock::Translator& translator);

    /// None: its time is believed.
    std::optional<Implausibility> judge(const wire::Event& event, HostTime received);

 private:
    const clock::Translator& translator_;
    std::uint32_t clock_life_ = 0;
    MajorityFilter<PulseHistory> pps_;
};

}  // namespace versavis::daemon
