// SPDX-License-Identifier: BSD-3-Clause
#include "diagnostics.hpp"

#include <cstdint>
#include <vector>

#include "base/json_text.hpp"
#include "recording/cdr_writer.hpp"

namespace versavis::dds {

namespace {

using client::text;
using nlohmann::json;

/// Of diagnostic_msgs/msg/DiagnosticStatus.
enum class Level : std::uint8_t { ok = 0, warn = 1, error = 2, stale = 3 };

struct Value {
    std::string key;
    std::string text;
};

struct Status {
    Level level = Level::ok;
    std::string name;
    std::string message;
    std::string hardware;
    std::vector<Value> values{};
};

Level level_of(const json& device) {
    const std::string health = text(device, "health");
    if (health == "degraded") return Level::error;
    if (health == "ok") return text(device, "hint").empty() ? Level::ok : Level::warn;
    return Level::warn;  // it starts
}

/// All of a device that is not a list of its own: names are those of docs/contracts/status.md.
std::vector<Value> values_of(const json& device) {
    std::vector<Value> values;
    for (const auto& [key, value] : device.items())
        if (value.is_string())
            values.push_back({key, value.get<std::string>()});
        else if (value.is_primitive() && !value.is_null())
            values.push_back({key, value.dump()});
    return values;
}

Status status_of(const std::string& instance, const std::string& name, const json& device) {
    const std::string fault = text(device, "fault");
    const std::string hint = text(device, "hint");
    std::string message = text(device, "state");
    if (!fault.empty()) message += ", " + fault;
    if (!hint.empty()) message += ": " + hint;
    return {level_of(device), instance + ": " + name, message, text(device, "serial"),
            values_of(device)};
}

std::vector<Status> statuses_of(const std::string& instance, const json& document) {
    std::vector<Status> statuses;
    // What a stamp means, which no message of ROS says.
    const auto add = [&](const std::string& name, const json& device, const char* stamp) {
        if (text(device, "state") == "unused") return;
        statuses.push_back(status_of(instance, name, device));
        if (*stamp != '\0') statuses.back().values.push_back({"stamp", stamp});
    };
    for (const char* part : {"board", "clock"})
        if (document.contains(part)) add(part, document[part], "");
    for (const json& camera : document.value("cameras", json::array()))
        add(text(camera, "name"), camera,
            text(camera, "trigger") == "board" ? "middle of the exposure" : "arrival of the frame");
    for (const json& imu : document.value("imus", json::array()))
        add(text(imu, "name"), imu, "instant of the motion");
    return statuses;
}

}  // namespace

std::string diagnostics_message(const std::string& instance, const json& status,
                                const std::string& silence, OutputTime now) {
    const std::vector<Status> statuses =
        status.is_object()
            ? statuses_of(instance, status)
            : std::vector<Status>{{Level::stale, instance + ": service", silence, "", {}}};
    client::CdrWriter message;
    message.header(now, "").number(static_cast<std::uint32_t>(statuses.size()));
    for (const Status& one : statuses) {
        message.number(static_cast<std::uint8_t>(one.level))
            .text(one.name)
            .text(one.message)
            .text(one.hardware)
            .number(static_cast<std::uint32_t>(one.values.size()));
        for (const Value& value : one.values) message.text(value.key).text(value.text);
    }
    return message.bytes();
}

}  // namespace versavis::dds
