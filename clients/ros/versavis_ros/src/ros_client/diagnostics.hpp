// SPDX-License-Identifier: BSD-3-Clause
// The service's status as ROS shows states: what a DiagnosticArray has.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace versavis::ros_client {

/// Of diagnostic_msgs/DiagnosticStatus.
enum class Level : std::uint8_t { ok = 0, warn = 1, error = 2, stale = 3 };

struct DiagnosticValue {
    std::string key;
    std::string text;
};

struct DiagnosticStatus {
    Level level = Level::ok;
    std::string name;  ///< "INSTANCE: DEVICE"
    std::string message;
    std::string hardware_id;  ///< the serial number, where it is known
    std::vector<DiagnosticValue> values;
};

/// One for each device. `status`: the document of docs/contracts/status.md; null: there is no
/// living service, for the reason `silence`.
std::vector<DiagnosticStatus> diagnostics(const std::string& instance, const nlohmann::json& status,
                                          const std::string& silence);

}  // namespace versavis::ros_client
