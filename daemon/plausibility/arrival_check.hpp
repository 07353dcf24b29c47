// SPDX-License-Identifier: BSD-3-Clause
// Holds the board's time of a message against the host's time when it was here.
#pragma once

#include <optional>

#include "engine/clock/translator.hpp"
#include "engine/plausibility/implausibility.hpp"

namespace versavis::daemon {

/// `at`: the newest instant in the message. None also while the board's clock is
/// unknown.
std::optional<Implausibility> contradicts_arrival(BoardTime at, HostTime received,
                                                  const clock::Translator& translator);

}  // namespace versavis::daemon
