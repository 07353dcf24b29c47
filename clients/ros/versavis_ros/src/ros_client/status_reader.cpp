// SPDX-License-Identifier: BSD-3-Clause
#include "ros_client/status_reader.hpp"

#include <ctime>

#include "versavis/status.hpp"

namespace versavis::ros_client {

namespace {

using nlohmann::json;

/// Documents of the service have some five levels.
constexpr int deepest = 64;

}  // namespace

OutputTime time_of_day() {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return OutputTime{now.tv_sec * 1'000'000'000 + now.tv_nsec};
}

ClockReading read_clocks() { return {host_now(), time_of_day().ns}; }

Expected<json> read_status(const std::string& instance) {
    StreamOptions options;
    options.instance = instance;
    const auto newest = versavis::read_status(options);
    if (!newest) return Unexpected<>(newest.error());
    const auto shallow = [](int depth, json::parse_event_t, json&) { return depth <= deepest; };
    const json document = json::parse(*newest, shallow, false);
    if (!document.is_object() || document.value("schema", json()) != 1)
        return failure("instance " + instance, "the status document has another version",
                       "install service and clients of the same release");
    return document;
}

}  // namespace versavis::ros_client
