// SPDX-License-Identifier: BSD-3-Clause
#include "pairing/evidence_json.hpp"

#include <fmt/format.h>

namespace versavis::client {

namespace {

using nlohmann::json;
using namespace pairing;

json describe(const Limits& limits) {
    return {{"evidence", "begin"},
            {"period_ns", limits.period.ns},
            {"earliest_arrival_ns", limits.earliest_arrival.ns},
            {"latest_arrival_ns", limits.latest_arrival.ns},
            {"exposure_wait_ns", limits.exposure_wait.ns},
            {"pattern_duration_ns", limits.pattern_duration.ns},
            {"frames_held", limits.frames_held},
            {"camera_clock", limits.camera_clock},
            {"stamp_instant", static_cast<std::uint32_t>(limits.stamped)}};
}

json describe(const Exposure& exposure) {
    return {{"evidence", "exposure"},
            {"trigger", exposure.trigger},
            {"tick", exposure.tick},
            {"start_ns", exposure.start.ns},
            {"end_ns", exposure.end.ns},
            {"end_on_host_ns", exposure.end_on_host.ns},
            {"earliest_on_host_ns", exposure.earliest_on_host.ns},
            {"stamp", static_cast<std::uint32_t>(exposure.kind)},
            {"exposed", exposure.exposed},
            {"recorded_ns", exposure.recorded.ns}};
}

json describe(const Arrival& arrival) {
    return {{"evidence", "arrival"},
            {"slot", arrival.slot},
            {"block_id", arrival.block_id},
            {"camera_time_ns", arrival.camera_time.ns},
            {"arrived_ns", arrival.arrived.ns},
            {"exposure_ns", arrival.exposure.ns}};
}

json describe(const Shortfall& shortfall) {
    return {{"evidence", "shortfall"},
            {"block_id", shortfall.block_id},
            {"reason", static_cast<std::uint32_t>(shortfall.reason)}};
}

json describe(const Advance& advance) {
    return {{"evidence", "advance"}, {"now_ns", advance.now.ns}};
}

json describe(const Reset& reset) {
    return {{"evidence", "reset"}, {"records_too", reset.records_too}};
}

json describe(const StartRequest& request) {
    return {{"evidence", "start"},
            {"start", static_cast<std::uint32_t>(request.start)},
            {"now_ns", request.now.ns}};
}

json describe(const RecordLimits& limits) {
    return {{"evidence", "record_limits"},
            {"period_ns", limits.period.ns},
            {"latency_ns", limits.latency.ns},
            {"exposure_ns", limits.exposure.ns},
            {"max_exposure_ns", limits.max_exposure.ns},
            {"grid_slew_ppm", limits.grid_slew_ppm},
            {"wired", limits.wired},
            {"slave", limits.slave},
            {"fixed_grid", limits.fixed_grid}};
}

/// Times that the board does not know are null.
json describe(const ReceivedRecord& received) {
    const wire::Exposure& record = received.record;
    const auto time = [](std::int64_t ns) { return ns == wire::no_time ? json() : json(ns); };
    return {{"evidence", "record"},
            {"trigger", record.trigger},
            {"tick", record.tick},
            {"flags", record.flags},
            {"trigger_ns", time(record.trigger_ns)},
            {"start_ns", time(record.start_ns)},
            {"end_ns", time(record.end_ns)},
            {"commanded_ns", received.commanded.ns},
            {"exchanges", received.exchanges},
            {"expected_ns", received.expected_ns},
            {"arrival", static_cast<std::uint32_t>(received.arrival)},
            {"clock_contradicted", received.clock_contradicted},
            {"promptness", static_cast<std::uint32_t>(received.promptness)},
            {"grid_ns", received.grid_ns}};
}

json describe(const TriggersSkipped& skipped) {
    return {{"evidence", "triggers_skipped"}, {"count", skipped.count}};
}

Limits limits(const json& line) {
    Limits limits;
    limits.period.ns = line.at("period_ns");
    limits.earliest_arrival.ns = line.at("earliest_arrival_ns");
    limits.latest_arrival.ns = line.at("latest_arrival_ns");
    limits.exposure_wait.ns = line.at("exposure_wait_ns");
    limits.pattern_duration.ns = line.at("pattern_duration_ns");
    limits.frames_held = line.at("frames_held");
    limits.camera_clock = line.at("camera_clock");
    limits.stamped = static_cast<Instant>(line.value("stamp_instant", 0U));  // older: not recorded
    return limits;
}

Exposure exposure(const json& line) {
    Exposure exposure;
    exposure.trigger = line.at("trigger");
    exposure.tick = line.at("tick");
    exposure.start.ns = line.at("start_ns");
    exposure.end.ns = line.at("end_ns");
    exposure.end_on_host.ns = line.at("end_on_host_ns");
    exposure.earliest_on_host.ns = line.at("earliest_on_host_ns");
    exposure.kind = static_cast<StampKind>(line.at("stamp").get<std::uint32_t>());
    exposure.exposed = line.at("exposed");
    exposure.recorded.ns = line.value("recorded_ns", std::int64_t{0});
    return exposure;
}

Arrival arrival(const json& line) {
    Arrival arrival;
    arrival.slot = line.at("slot");
    arrival.block_id = line.at("block_id");
    arrival.camera_time.ns = line.at("camera_time_ns");
    arrival.arrived.ns = line.at("arrived_ns");
    arrival.exposure.ns = line.at("exposure_ns");
    return arrival;
}

RecordLimits record_limits(const json& line) {
    RecordLimits limits;
    limits.period.ns = line.at("period_ns");
    limits.latency.ns = line.at("latency_ns");
    limits.exposure.ns = line.at("exposure_ns");
    limits.max_exposure.ns = line.at("max_exposure_ns");
    limits.grid_slew_ppm = line.at("grid_slew_ppm");
    limits.wired = line.at("wired");
    limits.slave = line.at("slave");
    limits.fixed_grid = line.value("fixed_grid", false);  // older: not recorded
    return limits;
}

ReceivedRecord received_record(const json& line) {
    const auto time = [&](const char* key) {
        return line.at(key).is_null() ? wire::no_time : line.at(key).get<std::int64_t>();
    };
    ReceivedRecord received;
    received.record.trigger = line.at("trigger");
    received.record.tick = line.at("tick");
    received.record.flags = line.at("flags");
    received.record.trigger_ns = time("trigger_ns");
    received.record.start_ns = time("start_ns");
    received.record.end_ns = time("end_ns");
    received.commanded.ns = line.at("commanded_ns");
    received.exchanges = line.at("exchanges");
    received.expected_ns = line.at("expected_ns");
    received.arrival = static_cast<EventReason>(line.at("arrival").get<std::uint32_t>());
    received.clock_contradicted = line.at("clock_contradicted");
    received.promptness = static_cast<Promptness>(line.value("promptness", std::uint8_t{0}));
    received.grid_ns = line.value("grid_ns", std::int64_t{0});
    return received;
}

/// A number that is not whole may be too large for the integer that it would become.
void check_numbers(const json& line) {
    for (const auto& [key, value] : line.items())
        if (value.is_number_float() && key != "grid_slew_ppm")
            throw std::invalid_argument(fmt::format("'{}' must be an integer", key));
}

Evidence read(const json& line) {
    check_numbers(line);
    const std::string kind = line.at("evidence");
    if (kind == "begin") return limits(line);
    if (kind == "exposure") return exposure(line);
    if (kind == "arrival") return arrival(line);
    if (kind == "shortfall")
        return Shortfall{line.at("block_id"),
                         static_cast<EventReason>(line.at("reason").get<std::uint32_t>())};
    if (kind == "advance") return Advance{{line.at("now_ns")}};
    if (kind == "reset") return Reset{line.value("records_too", false)};  // older: not recorded
    if (kind == "start")
        return StartRequest{static_cast<Start>(line.at("start").get<std::uint32_t>()),
                            {line.at("now_ns")}};
    if (kind == "record_limits") return record_limits(line);
    if (kind == "record") return received_record(line);
    if (kind == "triggers_skipped") return TriggersSkipped{line.at("count")};
    throw std::invalid_argument(fmt::format("'{}' is not a kind of evidence", kind));
}

}  // namespace

json to_json(const Evidence& evidence) {
    return std::visit([](const auto& item) { return describe(item); }, evidence);
}

Expected<Evidence> to_evidence(const json& line) {
    try {
        return checked(read(line));
    } catch (const std::exception& error) {
        return failure("evidence", error.what());
    }
}

}  // namespace versavis::client
