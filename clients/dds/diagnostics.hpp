// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "ros_client/diagnostics.hpp"
#include "versavis/time.hpp"

namespace versavis::dds {

/// diagnostic_msgs/msg/DiagnosticArray in CDR. `now`: of the host's clock of the day.
std::string diagnostics_message(const std::vector<ros_client::DiagnosticStatus>& statuses,
                                OutputTime now);

}  // namespace versavis::dds
