// SPDX-License-Identifier: BSD-3-Clause
#include "ros_client/sync_graph.hpp"

#include "ros_client/json_text.hpp"

namespace versavis::ros_client {

namespace {

using nlohmann::json;

/// The wire format of protobuf: https://protobuf.dev/programming-guides/encoding
std::string varint(std::uint64_t value) {
    std::string bytes;
    for (; value > 0x7F; value >>= 7U) bytes += static_cast<char>(value | 0x80U);
    return bytes + static_cast<char>(value);
}

std::string number_field(unsigned field, std::uint64_t value) {
    return varint(field << 3U) + varint(value);
}

/// A text, or a message.
std::string field_of(unsigned field, const std::string& content) {
    constexpr unsigned with_length = 2;
    return varint(field << 3U | with_length) + varint(content.size()) + content;
}

// Numbers of fields, by message.
namespace clock_id {
constexpr unsigned sensor_id = 1;
constexpr unsigned system_clock_id = 5;
}  // namespace clock_id

namespace graph_update {
constexpr unsigned source = 1;
constexpr unsigned clock_diff_measurement = 3;
constexpr unsigned self_reported_clock_state_update = 11;
}  // namespace graph_update

constexpr unsigned only_field = 1;  ///< of SensorId and SystemClockId

std::string sensor(const std::string& frame_id) {
    return field_of(clock_id::sensor_id, field_of(only_field, frame_id));
}

ClockState state_of(const json& device) {
    const std::string health = text(device, "health");
    if (health == "starting") return ClockState::tracking;
    if (health != "ok") return ClockState::lost;
    const std::string pairing = text(device, "pairing");  // IMUs have none
    return pairing.empty() || pairing == "locked" ? ClockState::locked : ClockState::tracking;
}

}  // namespace

std::string clock_state_update(const std::string& source, const std::string& frame_id,
                               ClockState state) {
    const std::string update =
        field_of(1, sensor(frame_id)) + number_field(2, static_cast<std::uint64_t>(state));
    return field_of(graph_update::source, source) +
           field_of(graph_update::self_reported_clock_state_update, update);
}

std::string clock_difference_update(const std::string& source, const std::string& hostname,
                                    const std::string& frame_id, Duration difference) {
    const std::string system = field_of(clock_id::system_clock_id, field_of(only_field, hostname));
    const std::string measurement = field_of(1, system) + field_of(2, sensor(frame_id)) +
                                    number_field(3, static_cast<std::uint64_t>(difference.ns));
    return field_of(graph_update::source, source) +
           field_of(graph_update::clock_diff_measurement, measurement);
}

std::vector<std::string> graph_updates(const std::string& hostname, const json& status,
                                       const ClockReading& now) {
    const std::string source = "versavis/" + text(status, "instance");
    const json clock = status.value("clock", json::object());
    const auto output_minus_host = clock.find("output_minus_host_ns");
    const bool known = text(clock, "health") == "ok" && output_minus_host != clock.end() &&
                       output_minus_host->is_number_integer();
    const std::int64_t output_ns =
        known ? now.host.ns + output_minus_host->get<std::int64_t>() : now.realtime_ns;
    const Duration difference{output_ns - now.realtime_ns};
    std::vector<std::string> updates;
    const auto add = [&](const json& device) {
        const std::string name = text(device, "name");
        const ClockState state = state_of(device);
        updates.push_back(clock_state_update(source, name, state));
        if (state == ClockState::locked && known)
            updates.push_back(clock_difference_update(source, hostname, name, difference));
    };
    for (const json& camera : status.value("cameras", json::array()))
        if (text(camera, "trigger") == "board") add(camera);
    for (const json& imu : status.value("imus", json::array())) add(imu);
    return updates;
}

}  // namespace versavis::ros_client
