// SPDX-License-Identifier: BSD-3-Clause
#include "ros_client/diagnostics.hpp"

#include "ros_client/json_text.hpp"

namespace versavis::ros_client {

namespace {

using nlohmann::json;

Level level_of(const json& device) {
    const std::string health = text(device, "health");
    if (health == "degraded") return Level::error;
    if (health == "ok") return text(device, "hint").empty() ? Level::ok : Level::warn;
    return Level::warn;  // it starts
}

/// All of a device that is not a list of its own: names are those of docs/contracts/status.md.
std::vector<DiagnosticValue> values_of(const json& device) {
    std::vector<DiagnosticValue> values;
    for (const auto& [key, value] : device.items())
        if (value.is_string())
            values.push_back({key, value.get<std::string>()});
        else if (value.is_primitive() && !value.is_null())
            values.push_back({key, value.dump()});
    return values;
}

DiagnosticStatus status_of(const std::string& instance, const std::string& name,
                           const json& device) {
    const std::string fault = text(device, "fault");
    const std::string hint = text(device, "hint");
    std::string message = text(device, "state");
    if (!fault.empty()) message += ", " + fault;
    if (!hint.empty()) message += ": " + hint;
    return {level_of(device), instance + ": " + name, message, text(device, "serial"),
            values_of(device)};
}

}  // namespace

std::vector<DiagnosticStatus> diagnostics(const std::string& instance, const json& status,
                                          const std::string& silence) {
    if (!status.is_object()) return {{Level::stale, instance + ": service", silence, "", {}}};
    std::vector<DiagnosticStatus> statuses;
    // What a stamp means, which no message of ROS says.
    const auto add = [&](const std::string& name, const json& device, const char* stamp) {
        if (text(device, "state") == "unused") return;
        statuses.push_back(status_of(instance, name, device));
        if (*stamp != '\0') statuses.back().values.push_back({"stamp", stamp});
    };
    for (const char* part : {"board", "clock"})
        if (status.contains(part)) add(part, status[part], "");
    for (const json& camera : status.value("cameras", json::array()))
        add(text(camera, "name"), camera,
            text(camera, "trigger") == "board" ? "middle of the exposure" : "arrival of the frame");
    for (const json& imu : status.value("imus", json::array()))
        add(text(imu, "name"), imu, "instant of the motion");
    for (const char* kind : {"time_outputs", "lidars"})
        for (const json& device : status.value(kind, json::array()))
            add(text(device, "name"), device, "");
    return statuses;
}

}  // namespace versavis::ros_client
