// SPDX-License-Identifier: BSD-3-Clause
// The configuration as the board gets it, and the board's refusals in the words of the file.
#pragma once

#include <string>

#include "configuration.hpp"

namespace versavis::daemon {

/// What is sent to the board.
wire::Configuration board_configuration(const Configuration& configuration);

/// Place, table and key that the board refuses, its value and what is allowed, in the unit of the
/// key.
std::string describe(const Configuration& configuration, const wire::Refusal& refusal);

}  // namespace versavis::daemon
