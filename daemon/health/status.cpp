// SPDX-License-Identifier: BSD-3-Clause
#include "status.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/board/board_words.hpp"
#include "engine/board/firmware_version.hpp"
#include "settings/receive_mode.hpp"

namespace versavis::daemon {

namespace {

using nlohmann::json;

constexpr int schema = 1;

/// Of all devices, in the order of cause.
std::vector<std::pair<std::string, const Diagnosis*>> diagnoses(const Status& status) {
    std::vector<std::pair<std::string, const Diagnosis*>> all{{"board", &status.board_diagnosis},
                                                              {"clock", &status.clock_diagnosis}};
    for (const CameraStatus& camera : status.cameras)
        all.emplace_back(camera.name, &camera.diagnosis);
    for (const ImuStatus& imu : status.imus) all.emplace_back(imu.report.name, &imu.diagnosis);
    for (const TimeOutputStatus& output : status.time_outputs)
        all.emplace_back(output.report.name, &output.diagnosis);
    for (const LidarStatus& lidar : status.lidars)
        all.emplace_back(lidar.report.source, &lidar.diagnosis);
    return all;
}

/// The keys that every device has; they replace those of the same name.
json with_diagnosis(json device, const Diagnosis& diagnosis) {
    device.update({{"health", to_string(diagnosis.health)},
                   {"fault", to_string(diagnosis.fault)},
                   {"since_ns", diagnosis.since.ns},
                   {"hint", diagnosis.hint}});
    return device;
}

/// What is not known is null: a zero would be a claim.
json known(bool is_known, Duration value) { return is_known ? json(value.ns) : json(nullptr); }
/// Of an IMU, which the board drives.
const char* state(const ImuStatus& imu, const Status& status) {
    if (status.board.state != BoardState::running) return "absent";
    if (imu.delivery.full || imu.report.working) return "running";
    return imu.report.failure.times > 0 ? "failed" : "opening";
}

json board_json(const BoardReport& board, bool needed, bool outdated) {
    const wire::Health& health = board.health;
    const bool known = board.connections > 0;
    const bool good_pps = health.pps_state == wire::PpsState::good;
    return {{"state", needed ? to_string(board.state) : "unused"},
            {"port", board.port},
            {"serial", board.serial},
            {"firmware", board.firmware},
            {"firmware_outdated", known ? json(outdated) : json(nullptr)},
            {"present", known ? json(board::part_names(board.present)) : json(nullptr)},
            {"fastest_imu_hz", known ? json(board.fastest_imu_millihertz * 1e-3) : json(nullptr)},
            {"nonce", board.nonce},
            {"connections", board.connections},
            {"packets", board.packets},
            {"lost_packets", board.lost_packets},
            {"malformed_packets", board.malformed},
            {"impossible_packets", board.impossible},
            {"exchanges_doubted", board.exchanges_doubted},
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
            {"glitches", health.glitches},
            {"noisy_inputs", health.noisy_inputs},
            {"skipped_triggers", health.skipped_triggers},
            {"imu_errors", health.imu_errors[0] + health.imu_errors[1]},
            {"imu_restarts", health.imu_restarts},
            {"loop_max_ns", health.loop_max_ns},
            {"reset_cause", board::to_string(health.reset_cause)},
            {"pps", board::to_string(health.pps_state)},
            {"pps_error_ppb", good_pps ? json(health.pps_error_ppb) : json(nullptr)},
            {"sync", board.awaits_sync ? "awaited" : board::to_string(health.sync_state)},
            {"stamp_test", board::to_string(health.stamp_test)}};
}

json clock_json(const clock::ClockReport& clock, const GridReport& grid) {
    const bool clock_known =
        clock.state != clock::ClockState::init && clock.state != clock::ClockState::reset;
    const bool readable = clock.kernel.error == 0;
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
            {"host_synchronised", readable ? json(clock.kernel.synchronised) : json(nullptr)},
            {"host_max_error_ns", known(readable, clock.kernel.max_error)},
            {"tai_offset_s", clock.kernel.tai_offset_s},
            {"tai_valid", clock.kernel.tai_offset_s != 0},
            {"asymmetry_ns", clock.asymmetry.offset.ns},
            {"asymmetry_sigma_ns", clock.asymmetry.sigma.ns},
            {"asymmetry_source", to_string(clock.asymmetry_source)},
            {"pps", to_string(clock.pps.state)},
            {"pps_residual_ns", clock.pps.residual.ns},
            {"pps_pulses", clock.pps.pulses},
            {"pps_rejected", clock.pps.rejected},
            {"second_difference_s", clock.pps.second_difference},
            {"grid_aligned", grid.aligned},
            {"grid_error_ns", grid.error.ns}};
}

json step_json(const StepResult& step) {
    return {{"group", step.group},
            {"node", step.node()},
            {"wanted", step.wanted},
            {"actual", step.actual.empty() ? json(nullptr) : json(step.actual)},
            {"outcome", to_string(step.outcome)},
            {"needed", step.needed},
            {"reason", step.reason}};
}

/// What the preset set, or could not set; not what the camera lacks and need not have.
json setup_json(const std::vector<StepResult>& steps) {
    json setup = json::array();
    for (const StepResult& step : steps)
        if (step.needed || step.outcome != StepOutcome::left_out) setup.push_back(step_json(step));
    return setup;
}

const char* to_string(TriggerSource trigger) {
    switch (trigger) {
        case TriggerSource::board: return "board";
        case TriggerSource::free_run: return "free";
        case TriggerSource::ptp: return "ptp";
    }
    return "unknown";
}

json text_or_null(const std::string& text) { return text.empty() ? json() : json(text); }

/// Null: the board does not see its exposures.
json strobe_json(const std::optional<StrobeReport>& strobe) {
    if (!strobe) return {};
    return {{"compared", strobe->compared},
            {"contradicting", strobe->contradicting},
            {"error_ns", strobe->error ? json(strobe->error->ns) : json()}};
}

/// Null: it is not triggered by PTP time.
json ptp_clock_json(const CameraStatus& status, const std::optional<PtpReport>& ptp) {
    if (!ptp || status.configuration.trigger != TriggerSource::ptp) return {};
    const auto found = std::find_if(ptp->clocks.begin(), ptp->clocks.end(),
                                    [&](const auto& clock) { return clock.name == status.name; });
    if (found == ptp->clocks.end()) return {};
    const PtpStatus& port = found->status;
    const bool known = found->agreement != clock::Agreement::unknown;
    return {{"port", text_or_null(port.state)},
            {"follows", port.follows()},
            {"offset_ns", port.offset ? json(port.offset->ns) : json()},
            {"grandmaster", text_or_null(port.grandmaster)},
            {"agrees", known ? json(found->agreement == clock::Agreement::agrees) : json()},
            {"readings", found->readings},
            {"readings_differing", found->differing},
            {"reading_width_ns", found->width.ns},
            {"start_delay_ns", status.pipeline.start_delay.ns},
            {"actions_refused", status.pipeline.actions_refused},
            {"strobe", strobe_json(status.pipeline.strobe)}};
}

/// Null: no camera is triggered by PTP time.
json ptp_json(const std::optional<PtpReport>& ptp) {
    if (!ptp) return {};
    const bool known = ptp->minus_utc.has_value();
    return {{"state", clock::to_string(ptp->state)},
            {"sigma_ns", known ? json(ptp->sigma.ns) : json()},
            {"bound_ns", known ? json(ptp->bound.ns) : json()},
            {"steps", ptp->steps},
            {"minus_utc_ns", known ? json(ptp->minus_utc->ns) : json()},
            {"master", text_or_null(ptp->master)},
            {"contradicted", text_or_null(ptp->contradicted)}};
}

json camera_json(const CameraStatus& status, const std::optional<PtpReport>& ptp) {
    const CameraReport& camera = status.camera;
    const PipelineReport& pipeline = status.pipeline;
    const bool free = status.configuration.trigger == TriggerSource::free_run;
    return {{"name", status.name},
            {"state", to_string(camera.state)},
            {"configured_hz", status.configuration.rate_hz},
            {"delivered_hz", status.delivery.rate_hz},
            {"trigger", to_string(status.configuration.trigger)},
            {"pairing", free ? "none" : pairing::to_string(pipeline.pairing)},
            {"ptp", ptp_clock_json(status, ptp)},
            {"stamp_instant", pairing::to_string(pipeline.stamp_instant)},
            {"vendor", camera.vendor},
            {"preset", camera.preset},
            {"setup", setup_json(camera.steps)},
            {"gain", camera.sensor.gain},
            {"gain_feature", camera.gain_feature},
            {"temperature_c", camera.sensor.temperature_c},
            {"link", camera.bandwidth.link},
            {"needed_mbps", camera.bandwidth.needed_mbps},
            {"link_needed_mbps", camera.bandwidth.link_needed_mbps},
            {"link_mbps", camera.bandwidth.link_mbps},
            {"packet_delay_ns", camera.bandwidth.packet_delay.ns},
            {"model", camera.model},
            {"serial", camera.serial},
            {"packet_size", camera.packet_size},
            {"receive", to_string(camera.receive)},
            {"connections", camera.connections},
            {"frames_received", pipeline.received},
            {"frames_incomplete", pipeline.incomplete},
            {"frames_published", pipeline.published},
            {"frames_without_trigger", pipeline.frames_without_trigger},
            {"triggers", pipeline.triggers},
            {"triggers_without_frame", pipeline.triggers_without_frame},
            {"triggers_missed", pipeline.triggers_missed},
            {"exposures_unmeasured", pipeline.unmeasured},
            {"records_doubted", pipeline.records_doubted},
            {"frames_suspect", pipeline.suspect},
            {"frames_without_buffer", pipeline.no_buffer},
            {"exposure_ns", pipeline.exposure.ns},
            {"camera_exposure_ns", pipeline.camera_exposure.ns},
            {"exposure_source", to_string(pipeline.exposure_source)},
            {"line", pipeline.lines.line},
            {"line_delay_start_ns", pipeline.lines.start.delay.ns},
            {"line_delay_end_ns", pipeline.lines.end.delay.ns},
            {"line_delay_sigma_ns", middle_sigma(pipeline.lines).ns},
            {"line_delay_source", to_string(pipeline.lines.source)},
            {"trigger_delay_ns", pipeline.lines.trigger.delay.ns},
            {"edge_difference_ns", known(pipeline.edges.frames != 0, pipeline.edges.difference)},
            {"edge_difference_sigma_ns", known(pipeline.edges.frames != 0, pipeline.edges.sigma)},
            {"edge_correction_ns", pipeline.edges.correction.ns},
            {"locks", pipeline.locks},
            {"slips", pipeline.slips},
            {"last_frame_ns", pipeline.last_frame.ns}};
}

}  // namespace

bool firmware_outdated(const Status& status) {
    return board::is_older(status.board.firmware, status.release);
}

Health health(const Status& status) {
    Health worst = Health::ok;
    for (const auto& [name, diagnosis] : diagnoses(status))
        worst = std::max(worst, diagnosis->health);
    return worst;
}

Summary summary(const Status& status) {
    const Health worst = health(status);
    Summary summary;
    summary.health = worst;
    summary.text = to_string(worst);
    for (const CameraStatus& camera : status.cameras)
        summary.cameras.push_back({camera.name, to_string(camera.camera.state),
                                   camera.diagnosis.health, camera.diagnosis.hint});
    if (worst == Health::ok) return summary;
    std::string others;
    for (const auto& [name, diagnosis] : diagnoses(status)) {
        if (diagnosis->health != worst) continue;
        if (summary.cause.empty()) {
            summary.cause = fmt::format("{}: {}", name, to_string(diagnosis->fault));
            summary.fault = diagnosis->fault;
            summary.text += fmt::format(": {}: {}", name, diagnosis->hint);
        } else {
            others += (others.empty() ? "" : ", ") + name;
        }
    }
    if (!others.empty()) summary.text += fmt::format(" (also {}: {})", to_string(worst), others);
    const auto dead = [](const auto& stream) {
        return stream.diagnosis.health == Health::degraded && stream.delivery.rate_hz == 0;
    };
    summary.dead = std::any_of(status.cameras.begin(), status.cameras.end(), dead) ||
                   std::any_of(status.imus.begin(), status.imus.end(), dead);
    return summary;
}

std::string to_json(const Status& status) {
    json cameras = json::array();
    for (const CameraStatus& camera : status.cameras)
        cameras.push_back(with_diagnosis(camera_json(camera, status.ptp), camera.diagnosis));
    json imus = json::array();
    for (const ImuStatus& imu : status.imus)
        imus.push_back(
            with_diagnosis({{"name", imu.report.name},
                            {"model", imu.report.model},
                            {"state", state(imu, status)},
                            {"configured_hz", imu.report.rate_hz},
                            {"delivered_hz", imu.delivery.rate_hz},
                            {"published", imu.report.published},
                            {"lost", imu.report.lost},
                            {"no_clock", imu.report.no_clock},
                            {"faulty", imu.report.faulty},
                            {"repeated", imu.report.repeated},
                            {"doubted", imu.report.doubted},
                            {"filter_delay_ns", imu.report.filter.delay.ns},
                            {"filter_delay_sigma_ns", imu.report.filter.sigma.ns},
                            {"filter_delay_source", imu::to_string(imu.report.filter.source)},
                            {"last_sample_ns", imu.report.last_sample.ns}},
                           imu.diagnosis));
    json time_outputs = json::array();
    for (const TimeOutputStatus& output : status.time_outputs) {
        const TimeOutputReport& report = output.report;
        time_outputs.push_back(
            with_diagnosis({{"name", report.name},
                            {"state", to_string(report.state)},
                            {"pulses", report.pulses},
                            {"utc_s", report.pulses != 0 ? json(report.utc_s) : json(nullptr)},
                            {"error_ns", report.error ? json(report.error->ns) : json(nullptr)}},
                           output.diagnosis));
    }
    json lidars = json::array();
    for (const LidarStatus& lidar : status.lidars) {
        const LidarReport& report = lidar.report;
        lidars.push_back(
            with_diagnosis({{"name", report.source},
                            {"maker", report.maker},
                            {"state", report.verdict},
                            {"behind_ns", report.behind ? json(report.behind->ns) : json()},
                            {"ahead_ns", report.ahead ? json(report.ahead->ns) : json()}},
                           lidar.diagnosis));
    }
    json nmea;
    if (status.nmea)
        nmea = {{"stream", nmea_stream},
                {"sentences", status.nmea->sentences},
                {"damaged", status.nmea->damaged},
                {"suspect", status.nmea->suspect},
                {"lost", status.nmea->lost}};
    json streams = json::array();
    for (const StreamStatus& stream : status.streams)
        streams.push_back({{"name", stream.name},
                           {"kind", stream.kind},
                           {"items", stream.items},
                           {"rate_hz", stream.rate_hz}});
    const json document{
        {"schema", schema},
        {"instance", status.instance},
        {"release", status.release},
        {"configuration", status.configuration},
        {"pid", ::getpid()},
        {"started_ns", status.started.ns},
        {"host_time_ns", status.now.ns},
        {"health", to_string(health(status))},
        {"board",
         with_diagnosis(board_json(status.board, status.board_needed, firmware_outdated(status)),
                        status.board_diagnosis)},
        {"clock", with_diagnosis(clock_json(status.clock, status.grid), status.clock_diagnosis)},
        {"cameras", cameras},
        {"imus", imus},
        {"ptp", ptp_json(status.ptp)},
        {"time_outputs", time_outputs},
        {"lidars", lidars},
        {"nmea", nmea},
        {"streams", streams}};
    // Names from devices may hold anything; what is no UTF-8 is replaced.
    return document.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace versavis::daemon
