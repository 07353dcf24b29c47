// SPDX-License-Identifier: BSD-3-Clause
// Rules for [[time_output]]: the board must have what it needs, and the LiDAR accept what it gets.
#pragma once

#include "configuration.hpp"
#include "findings.hpp"

namespace versavis::daemon {

void check_time_outputs(const Configuration& configuration, Findings& findings);

}  // namespace versavis::daemon
