// SPDX-License-Identifier: BSD-3-Clause
// The service's status as ROS 2 shows states: diagnostic_msgs/msg/DiagnosticArray.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "versavis/time.hpp"

namespace versavis::dds {

/// A status for each device, named "INSTANCE: DEVICE", in CDR. Null: there is no living service,
/// for the reason `silence`. `now`: of the host's clock of the day.
std::string diagnostics_message(const std::string& instance, const nlohmann::json& status,
                                const std::string& silence, OutputTime now);

}  // namespace versavis::dds
