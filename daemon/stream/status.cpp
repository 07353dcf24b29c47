// SPDX-License-Identifier: BSD-3-Clause
#include "stream/status.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

namespace versavis::daemon {

namespace {

using nlohmann::json;

constexpr int schema = 1;

/// After the start, what does not deliver yet is called starting. At half, slow cameras show as
/// degraded at first; at twice, a broken rig is called so five seconds later.
constexpr Duration grace = seconds(5);

/// Without a good sample for so long an IMU does not deliver. At half, a part that sets itself up
/// again shows as lost; at twice, a pulled cable shows three seconds later.
constexpr Duration imu_patience = seconds(3);

bool delivers(const CameraStatus& camera) {
    if (camera.camera.state != CameraState::streaming) return false;
    if (camera.stalled) return false;
    return !camera.triggered ||
           (camera.pipeline.pairing == pairing::State::locked && camera.pipeline.measured &&
            !camera.pipeline.exposure_contradicted);
}

std::string hint(const CameraStatus& status) {
    if (!status.camera.hint.empty() || status.camera.state != CameraState::streaming ||
        !status.triggered)
        return status.camera.hint;
    const std::string line = line_hint(status.pipeline.edges);
    if (!line.empty()) return line;
    if (status.pipeline.triggers == 0) return "no trigger yet: is the board running?";
    if (!status.pipeline.measured)
        return "exposures are not being measured: check the exposure line, 'strobe', 'latency_us' "
               "and "
               "'max_exposure_us'";
    if (status.pipeline.exposure_contradicted)
        return fmt::format(
            "the exposure line shows {} us, but the camera exposes {} us: check 'strobe_line' and "
            "its "
            "LineSource, or "
            "set check_exposure = false",
            status.pipeline.exposure.ns / 1000, status.pipeline.camera_exposure.ns / 1000);
    if (status.unproved)
        return "the frames do not follow this output's triggers: check that the trigger cable is "
               "on "
               "it, and "
               "TriggerSource";
    return status.stalled ? "triggers are sent but no frames come: check trigger cable and network"
                          : "";
}

const char* to_string(wire::ResetCause cause) {
    switch (cause) {
        case wire::ResetCause::power_on: return "power_on";
        case wire::ResetCause::pin: return "pin";
        case wire::ResetCause::watchdog: return "watchdog";
        case wire::ResetCause::brown_out: return "brown_out";
        case wire::ResetCause::software: return "software";
    }
    return "unknown";
}

const char* to_string(wire::PpsState state) {
    switch (state) {
        case wire::PpsState::none: return "none";
        case wire::PpsState::acquiring: return "acquiring";
        case wire::PpsState::good: return "good";
    }
    return "unknown";
}

/// What is not known is null: a zero would be a claim.
json known(bool is_known, Duration value) { return is_known ? json(value.ns) : json(nullptr); }

json board_json(const BoardReport& board, bool needed) {
    const wire::Health& health = board.health;
    return {{"state", needed ? to_string(board.state) : "unused"},
            {"since_ns", board.since.ns},
            {"hint", board.hint},
            {"port", board.port},
            {"serial", board.serial},
            {"firmware", board.firmware},
            {"nonce", board.nonce},
            {"connections", board.connections},
            {"packets", board.packets},
            {"lost_packets", board.lost_packets},
            {"malformed_packets", board.malformed},
            {"impossible_packets", board.impossible},
            {"dropped_bytes", board.dropped_bytes},
            {"dropped_by_board", health.dropped_exposures + health.dropped_clock_answers +
                                     health.dropped_events + health.dropped_imu_samples +
                                     health.dropped_logs},
            {"dropped",
             {{"exposures", health.dropped_exposures},
              {"clock_answers", health.dropped_clock_answers},
              {"events", health.dropped_events},
              {"imu_samples", health.dropped_imu_samples},
              {"logs", health.dropped_logs}}},
            {"late_outputs", health.late_outputs},
            {"lost_edges", health.lost_edges},
            {"stray_edges", health.stray_edges},
            {"noisy_inputs", health.noisy_inputs},
            {"skipped_triggers", health.skipped_triggers},
            {"imu_errors", health.imu_errors[0] + health.imu_errors[1]},
            {"imu_restarts", health.imu_restarts},
            {"loop_max_ns", health.loop_max_ns},
            {"reset_cause", to_string(health.reset_cause)},
            {"pps", to_string(health.pps_state)},
            {"pps_error_ppb", health.pps_error_ppb}};
}

json clock_json(const clock::ClockReport& clock, const GridReport& grid) {
    const bool clock_known =
        clock.state != clock::ClockState::init && clock.state != clock::ClockState::reset;
    return {{"state", clock::to_string(clock.state)},
            {"output", clock::to_string(clock.output)},
            {"sigma_ns", known(clock_known, clock.sigma)},
            {"bound_ns", known(clock_known, clock.bound)},
            {"residual_ns", clock.residual.ns},
            {"innovation_ns", clock.innovation.ns},
            {"since_contact_ns", clock.since_contact.ns},
            {"round_trip_ns", clock.round_trip.ns},
            {"smallest_round_trip_ns", clock.smallest_round_trip.ns},
            {"skew_ppm", clock.skew_ppm},
            {"skew_sigma_ppm", clock.skew_sigma_ppm},
            {"exchanges", clock.exchanges},
            {"one_way_messages", clock.one_way_messages},
            {"slots", clock.slots},
            {"surprises", clock.surprises},
            {"restarts", clock.restarts},
            {"epoch", clock.epoch},
            {"output_minus_host_ns", clock.output_minus_host.ns},
            {"output_steps", clock.output_steps},
            {"host_suspends", clock.host_suspends},
            {"host_synchronised", clock.kernel.synchronised},
            {"host_max_error_ns", clock.kernel.max_error.ns},
            {"tai_offset_s", clock.kernel.tai_offset_s},
            {"tai_valid", clock.kernel.tai_offset_s != 0},
            {"asymmetry_ns", clock.asymmetry.offset.ns},
            {"asymmetry_sigma_ns", clock.asymmetry.sigma.ns},
            {"asymmetry_source", to_string(clock.asymmetry_source)},
            {"pps", to_string(clock.pps.state)},
            {"pps_residual_ns", clock.pps.residual.ns},
            {"pps_pulses", clock.pps.pulses},
            {"pps_rejected", clock.pps.rejected},
            {"grid_aligned", grid.aligned},
            {"grid_error_ns", grid.error.ns}};
}

json camera_json(const CameraStatus& status) {
    const auto& [name, triggered, stalled, unproved, camera, pipeline] = status;
    return {{"name", name},
            {"state", to_string(camera.state)},
            {"since_ns", camera.since.ns},
            {"hint", hint(status)},
            {"trigger", triggered ? "board" : "free"},
            {"pairing", triggered ? pairing::to_string(pipeline.pairing) : "none"},
            {"stamp_instant", pairing::to_string(pipeline.stamp_instant)},
            {"vendor", camera.vendor},
            {"preset", camera.preset},
            {"temperature_c", camera.temperature_c},
            {"needed_mbps", camera.bandwidth.needed_mbps},
            {"link_needed_mbps", camera.bandwidth.link_needed_mbps},
            {"link_mbps", camera.bandwidth.link_mbps},
            {"packet_delay_ns", camera.bandwidth.packet_delay.ns},
            {"model", camera.model},
            {"serial", camera.serial},
            {"packet_size", camera.packet_size},
            {"connections", camera.connections},
            {"frames_received", pipeline.received},
            {"frames_incomplete", pipeline.incomplete},
            {"frames_published", pipeline.published},
            {"frames_without_trigger", pipeline.frames_without_trigger},
            {"triggers", pipeline.triggers},
            {"triggers_without_frame", pipeline.triggers_without_frame},
            {"exposures_unmeasured", pipeline.unmeasured},
            {"frames_suspect", pipeline.suspect},
            {"frames_without_buffer", pipeline.no_buffer},
            {"exposure_ns", pipeline.exposure.ns},
            {"camera_exposure_ns", pipeline.camera_exposure.ns},
            {"line", pipeline.lines.line},
            {"line_delay_start_ns", pipeline.lines.start.delay.ns},
            {"line_delay_end_ns", pipeline.lines.end.delay.ns},
            {"line_delay_sigma_ns", middle_sigma(pipeline.lines).ns},
            {"line_delay_source", to_string(pipeline.lines.source)},
            {"trigger_delay_ns", pipeline.lines.trigger.delay.ns},
            {"edge_difference_ns", known(pipeline.edges.frames != 0, pipeline.edges.difference)},
            {"edge_difference_sigma_ns", known(pipeline.edges.frames != 0, pipeline.edges.sigma)},
            {"locks", pipeline.locks},
            {"slips", pipeline.slips},
            {"last_frame_ns", pipeline.last_frame.ns}};
}

}  // namespace

std::string health(const Status& status) {
    bool ok = !status.board_needed || (status.board.state == BoardState::running &&
                                       status.clock.state == clock::ClockState::locked);
    for (const CameraStatus& camera : status.cameras) ok = ok && delivers(camera);
    for (const ImuReport& imu : status.imus) ok = ok && status.now - imu.last_sample < imu_patience;
    if (ok) return "ok";
    return status.now - status.started < grace ? "starting" : "degraded";
}

std::string to_json(const Status& status) {
    json cameras = json::array();
    for (const CameraStatus& camera : status.cameras) cameras.push_back(camera_json(camera));
    json imus = json::array();
    for (const ImuReport& imu : status.imus)
        imus.push_back({{"name", imu.name},
                        {"model", imu.model},
                        {"published", imu.published},
                        {"lost", imu.lost},
                        {"no_clock", imu.no_clock},
                        {"faulty", imu.faulty},
                        {"filter_delay_ns", imu.filter.delay.ns},
                        {"filter_delay_sigma_ns", imu.filter.sigma.ns},
                        {"filter_delay_source", imu::to_string(imu.filter.source)},
                        {"last_sample_ns", imu.last_sample.ns}});
    json streams = json::array();
    for (const StreamStatus& stream : status.streams)
        streams.push_back({{"name", stream.name},
                           {"kind", stream.kind},
                           {"items", stream.items},
                           {"rate_hz", stream.rate_hz}});
    const json document{{"schema", schema},
                        {"instance", status.instance},
                        {"pid", ::getpid()},
                        {"started_ns", status.started.ns},
                        {"host_time_ns", status.now.ns},
                        {"health", health(status)},
                        {"board", board_json(status.board, status.board_needed)},
                        {"clock", clock_json(status.clock, status.grid)},
                        {"cameras", cameras},
                        {"imus", imus},
                        {"streams", streams}};
    // Names from devices may hold anything; what is no UTF-8 is replaced.
    return document.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace versavis::daemon
