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

json describe(const Reset& /*reset*/) { return {{"evidence", "reset"}}; }

json describe(const StartRequest& request) {
    return {{"evidence", "start"},
            {"start", static_cast<std::uint32_t>(request.start)},
            {"now_ns", request.now.ns}};
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

Evidence read(const json& line) {
    const std::string kind = line.at("evidence");
    if (kind == "begin") return limits(line);
    if (kind == "exposure") return exposure(line);
    if (kind == "arrival") return arrival(line);
    if (kind == "shortfall")
        return Shortfall{line.at("block_id"),
                         static_cast<EventReason>(line.at("reason").get<std::uint32_t>())};
    if (kind == "advance") return Advance{{line.at("now_ns")}};
    if (kind == "reset") return Reset{};
    if (kind == "start")
        return StartRequest{static_cast<Start>(line.at("start").get<std::uint32_t>()),
                            {line.at("now_ns")}};
    throw std::invalid_argument(fmt::format("'{}' is not a kind of evidence", kind));
}

}  // namespace

json to_json(const Evidence& evidence) {
    return std::visit([](const auto& item) { return describe(item); }, evidence);
}

Expected<Evidence> to_evidence(const json& line) {
    try {
        return read(line);
    } catch (const std::exception& error) {
        return failure("evidence", error.what());
    }
}

}  // namespace versavis::client
