// SPDX-License-Identifier: BSD-3-Clause
// Holds the board's time of a message against the host's time when it was here.
#pragma once

#include <optional>

#include "engine/clock/translator.hpp"
#include "engine/plausibility/implausibility.hpp"

namespace versavis::daemon {

/// How long a message took from the newest instant that it names.
struct ArrivalDelay {
    Duration delay;
    Duration sigma;  ///< of differences of such delays, by the estimate of the board's clock
    std::optional<Implausibility> doubt;
};

/// `at`: the newest instant in the message. None while the board's clock is unknown.
std::optional<ArrivalDelay> arrival_delay(BoardTime at, HostTime received,
                                          const clock::Translator& translator);

/// The doubt alone.
std::optional<Implausibility> contradicts_arrival(BoardTime at, HostTime received,
                                                  const clock::Translator& translator);

}  // namespace versavis::daemon
