// SPDX-License-Identifier: BSD-3-Clause
// The service's status, for clients outside of this project's own build.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "ros_client/diagnostics.hpp"
#include "ros_client/sync_graph.hpp"
#include "versavis/time.hpp"

namespace versavis::ros_client {

/// Now, by the clock of the day.
OutputTime time_of_day();

/// Now, by both.
ClockReading read_clocks();

/// The newest document. Errors: there is no service, it has died, or publishes another version.
Expected<nlohmann::json> read_status(const std::string& instance);

}  // namespace versavis::ros_client
