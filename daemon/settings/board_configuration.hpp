// SPDX-License-Identifier: BSD-3-Clause
// The configuration as the board is told it, and the board's refusals in the words of the file.
#pragma once

#include <string>

#include "configuration.hpp"

namespace versavis::daemon {

/// What the board is told.
wire::Configuration board_configuration(const Configuration& configuration);

/// Place, table and key that the board refuses, its value and what is allowed, in the unit of the
/// key.
std::string describe(const Configuration& configuration, const wire::Refusal& refusal);

}  // namespace versavis::daemon
