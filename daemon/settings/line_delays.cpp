// SPDX-License-Identifier: BSD-3-Clause
#include "line_delays.hpp"

#include <algorithm>

#include "camera_preset.hpp"

namespace versavis::daemon {

namespace {

/// Sigma of an edge of an isolated line, or of one that nobody knows: makers state 1 to 110 us.
constexpr Duration unknown_isolated = microseconds(40);

/// The same for a line without isolation: makers state less than 2.5 us, a weak pull-up adds some.
constexpr Duration unknown_direct = microseconds(3);

const PresetLine* find_line(const CameraPreset& preset, const std::string& name) {
    const auto found = std::find_if(preset.lines.begin(), preset.lines.end(),
                                    [&](const PresetLine& line) { return line.name == name; });
    return found == preset.lines.end() ? nullptr : &*found;
}

EdgeDelay delay_of(const PresetLine* line, std::optional<EdgeDelay> PresetLine::*edge) {
    if (line != nullptr && line->*edge) return *(line->*edge);
    const bool direct = line != nullptr && line->kind == LineKind::direct;
    return {{}, direct ? unknown_direct : unknown_isolated};
}

/// The edge that the board sends is the one that the camera takes.
EdgeDelay trigger_delay(const CameraPreset& preset, const CameraConfiguration& camera,
                        const std::string& line) {
    return delay_of(find_line(preset, line), camera.trigger_inverted ? &PresetLine::input_falling
                                                                     : &PresetLine::input_rising);
}

EdgeDelay configured(const std::vector<double>& value_and_sigma_us) {
    return {from_us(value_and_sigma_us[0]), from_us(value_and_sigma_us[1])};
}

Duration from_ns(double ns) { return from_us(ns * 1e-3); }

}  // namespace

const char* to_string(DelaySource source) {
    switch (source) {
        case DelaySource::unknown: return "unknown";
        case DelaySource::preset: return "preset";
        case DelaySource::configuration: return "configuration";
    }
    return "unknown";
}

Duration middle_sigma(const LineDelays& lines) { return (lines.start.sigma + lines.end.sigma) / 2; }

LineDelays configured_delays(const CameraConfiguration& camera) {
    LineDelays delays;
    delays.trigger.delay = from_us(camera.latency_us) + from_ns(camera.board_output_ns);
    delays.start.delay = delays.end.delay = from_ns(camera.board_input_ns);
    return delays;
}

LineDelays line_delays(const CameraPreset& preset, const CameraConfiguration& camera,
                       const std::string& trigger_line, const std::string& strobe_line) {
    LineDelays delays = configured_delays(camera);
    if (camera.latency_us == 0) {
        const EdgeDelay taken = trigger_delay(preset, camera, trigger_line);
        delays.trigger = {delays.trigger.delay + taken.delay, taken.sigma};
    }
    if (camera.strobe == Strobe::none) return delays;
    const PresetLine* output = find_line(preset, strobe_line);
    EdgeDelay rising = delay_of(output, &PresetLine::output_rising);
    EdgeDelay falling = delay_of(output, &PresetLine::output_falling);
    delays.line = strobe_line;
    if (output != nullptr && output->output_rising && output->output_falling)
        delays.source = DelaySource::preset;
    if (!camera.strobe_rising_us.empty()) {
        rising = configured(camera.strobe_rising_us);
        falling = configured(camera.strobe_falling_us);
        delays.source = DelaySource::configuration;
    }
    // The line is active while the camera exposes: low, if it is active low.
    if (camera.strobe == Strobe::active_low) std::swap(rising, falling);
    delays.start = {delays.start.delay + rising.delay, rising.sigma};
    delays.end = {delays.end.delay + falling.delay, falling.sigma};
    return delays;
}

void use_named_preset(const std::vector<CameraPreset>& presets, CameraConfiguration& camera) {
    const auto found =
        std::find_if(presets.begin(), presets.end(),
                     [&](const CameraPreset& preset) { return preset.name == camera.preset; });
    if (found == presets.end() || camera.latency_us != 0) return;
    const std::string& line =
        camera.trigger_line.empty() ? found->trigger_lines.front() : camera.trigger_line;
    camera.latency_us = static_cast<double>(trigger_delay(*found, camera, line).delay.ns) * 1e-3;
}

}  // namespace versavis::daemon
