// SPDX-License-Identifier: BSD-3-Clause
// What a board has pins and peripherals for, and what a configuration asks for that it lacks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "configuration.hpp"

namespace versavis::daemon {

/// Each part that the configuration asks for and this board lacks, as one message: place, key,
/// what the board has, what to do.
std::vector<std::string> missing_parts(const Configuration& configuration,
                                       const wire::BoardHello& board);

/// The same for a part that the board refused as one that it lacks.
std::string describe_missing(const Configuration& configuration, const wire::Refusal& refusal);

/// What the firmware of this board is too old for, and what to do; empty: nothing.
std::string missing_capability(const Configuration& configuration, std::uint32_t capabilities);

}  // namespace versavis::daemon
