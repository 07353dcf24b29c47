// SPDX-License-Identifier: BSD-3-Clause
// The status document as OpenMetrics text, for Prometheus: base units, counters that end with
// _total, and no type but gauge and counter, so that node_exporter's textfile collector, which
// knows the older format, reads it, too.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

/// `status`: none if there is no living service; versavis_up is 0 then, and nothing else is there.
std::string openmetrics_text(const std::string& instance,
                             const std::optional<nlohmann::json>& status, HostTime now);

/// The names of all samples, for documents and alerts.
std::vector<std::string> metric_names();

}  // namespace versavis::client
