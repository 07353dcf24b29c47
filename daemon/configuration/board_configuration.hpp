// SPDX-License-Identifier: BSD-3-Clause
// The configuration as the board is told it, and the board's refusals in the words of the file.
#pragma once

#include <string>

#include "configuration/configuration.hpp"

namespace versavis::daemon {

/// What the board is told.
wire::Configuration board_configuration(const Configuration& configuration);

/// Which key the board refuses, its value and what is allowed.
std::string describe(const wire::Refusal& refusal);

}  // namespace versavis::daemon
