// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_setup.hpp"

#include <endian.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/log.hpp"
#include "camera/action_trigger.hpp"
#include "camera/u3v_client.hpp"

namespace versavis::daemon {

namespace {

/// Letters of a name that are looked at; GigE Vision knows 32.
constexpr std::size_t longest_name = 256;

/// The largest frame.
constexpr std::uint64_t largest_frame = 256 << 20;

/// Bytes that a pixel may take: three colours of 16 bits, and padding.
constexpr std::uint64_t most_bytes_per_pixel = 8;

/// What may follow the pixels, such as chunks.
constexpr std::uint64_t largest_extra = 1 << 20;

/// What the camera says of itself; empty when it does not.
std::string name_of(ArvCamera* camera, const char* (*get)(ArvCamera*, GError**)) {
    GlibError error;
    const char* value = get(camera, error.out());
    return error.set() || value == nullptr ? "" : std::string(value, strnlen(value, longest_name));
}

/// By what Aravis plans the transfers of a USB3 camera; zero: it does not say.
std::uint64_t transferred_payload(ArvDevice* device) {
    const auto read = [&](std::uint64_t address) {
        GlibError error;
        std::uint64_t value = 0;
        arv_device_read_memory(device, address, sizeof value, &value, error.out());
        return error.set() ? 0 : le64toh(value);
    };
    return read(read(read(abrm_sbrm) + sbrm_sirm) + sirm_payload);
}

/// Bytes of a frame with all that may follow the pixels. Errors: it does not say, or what it says
/// cannot be for images of its size.
Expected<std::uint64_t> payload_of(ArvCamera* camera, const CameraConfiguration& configuration) {
    GlibError error;
    ArvDevice* device = arv_camera_get_device(camera);
    // As 64 bits: arv_camera_get_payload() cuts off half of them.
    const gint64 announced =
        arv_device_get_integer_feature_value(device, "PayloadSize", error.out());
    if (error.set() || announced <= 0)
        return failure(configuration.name, "the camera does not say how large its frames are",
                       "power it off and on");
    const auto payload = static_cast<std::uint64_t>(announced);
    gint x = 0;
    gint y = 0;
    gint width = 0;
    gint height = 0;
    arv_camera_get_region(camera, &x, &y, &width, &height, error.out());
    const bool known = !error.set() && width > 0 && height > 0;
    const std::uint64_t pixels =
        known ? static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) : 0;
    const std::uint64_t most = std::min(
        largest_frame, known ? pixels * most_bytes_per_pixel + largest_extra : largest_frame);
    const auto transferred = ARV_IS_UV_DEVICE(device) ? transferred_payload(device) : payload;
    if (payload <= most && transferred > 0 && transferred <= most) return payload;
    return failure(configuration.name,
                   fmt::format("the camera announces frames of {} bytes for {} x {} pixels, more "
                               "than {} or none",
                               payload > most ? payload : transferred, width, height, most),
                   "set Width, Height and PixelFormat in [camera.features], or power it off and "
                   "on");
}

/// Groups of the preset, in the order that cameras need.
std::vector<std::string> wanted_groups(const CameraConfiguration& configuration) {
    std::vector<std::string> groups;
    if (!configuration.keep_settings) groups.emplace_back("default_settings");
    groups.emplace_back("known_state");
    if (configuration.chunks.value_or(false)) groups.emplace_back("chunks");
    const bool by_ptp = configuration.trigger == TriggerSource::ptp;
    if (configuration.ptp || by_ptp) groups.emplace_back("ptp");
    if (configuration.auto_exposure.enabled) groups.emplace_back("fixed_exposure");
    if (configuration.trigger == TriggerSource::free_run) {
        groups.emplace_back("free_run");
        return groups;
    }
    if (!configuration.auto_exposure.enabled) groups.emplace_back("exposure_limit");
    groups.emplace_back(by_ptp ? "action" : "trigger");
    if (by_ptp && configuration.strobe_input.empty()) return groups;
    if (configuration.exposure_by_pulse) groups.emplace_back("pulse_width");
    if (configuration.strobe != Strobe::none) groups.emplace_back("strobe");
    return groups;
}

/// Error: what is asked for, these cameras do not have.
Expected<> check_groups(const CameraPreset& preset, const CameraConfiguration& configuration) {
    for (const std::string& group : wanted_groups(configuration))
        if ((group == "chunks" || group == "ptp" || group == "action" || group == "pulse_width") &&
            preset.groups.at(group).empty())
            return failure(fmt::format("preset {}", preset.name),
                           fmt::format("these cameras have no '{}'", group),
                           "remove the key that asks for it, or set the features by name");
    return {};
}

/// The configuration's choice, else those of the preset.
std::vector<std::string> own_or(const std::string& own, const std::vector<std::string>& usual) {
    return own.empty() ? usual : std::vector{own};
}

PresetVariables variables_of(const CameraPreset& preset, const CameraConfiguration& configuration) {
    return {{"trigger", preset.triggers},
            {"trigger_line", own_or(configuration.trigger_line, preset.trigger_lines)},
            {"strobe_line", own_or(configuration.strobe_line, preset.strobe_lines)},
            {"chunk", preset.chunk_selector},
            {"chunk_gain", preset.chunk_gain_selector},
            {"line_inverter", {preset.line_inverter ? "true" : "false"}},
            {"max_exposure_us", {fmt::format("{:.0f}", std::floor(configuration.max_exposure_us))}},
            {"device_key", {std::to_string(action_device_key)}},
            {"group_key", {std::to_string(action_group_key)}},
            {"group_mask", {std::to_string(action_group_mask)}},
            {"edge", {configuration.trigger_inverted ? "FallingEdge" : "RisingEdge"}}};
}

/// The first of the features that reads as a number; empty: none.
std::string first_number(const AravisNodeMap& nodes, const std::vector<std::string>& features) {
    const auto found = std::find_if(features.begin(), features.end(), [&](const std::string& name) {
        return nodes.read_number(name).has_value();
    });
    return found == features.end() ? "" : *found;
}

/// The first of the features that the camera's description has.
ChunkFeature first_chunk(const AravisNodeMap& nodes, const std::vector<std::string>& features) {
    const std::string name = nodes.first_of(features);
    return {name, nodes.is_integer(name)};
}

/// Whether a step set something of one of the selector's values.
bool has_set(const std::vector<StepResult>& steps, const std::vector<std::string>& selected) {
    return std::any_of(steps.begin(), steps.end(), [&](const StepResult& step) {
        return step.outcome == StepOutcome::set &&
               std::find(selected.begin(), selected.end(), step.selected) != selected.end();
    });
}

/// By itself: no register says what it is of a frame.
bool changes_itself(const AravisNodeMap& nodes, const std::string& automatic) {
    const std::string mode = nodes.read(automatic);
    return !mode.empty() && mode != "Off";
}

/// What was set, as it reads now, with the exposure: where it changes, somebody else, or the camera
/// itself, changed it.
std::vector<std::pair<std::string, std::string>> watched(const AravisNodeMap& nodes,
                                                         const std::vector<StepResult>& steps,
                                                         const std::string& exposure_feature) {
    std::vector<std::pair<std::string, std::string>> features;
    const auto add = [&](const std::string& feature) {
        const bool known = std::any_of(features.begin(), features.end(),
                                       [&](const auto& entry) { return entry.first == feature; });
        const std::string value = known || feature.empty() ? "" : nodes.read(feature);
        if (!value.empty()) features.emplace_back(feature, value);
    };
    for (const StepResult& step : steps)
        if ((step.group == "trigger" || step.group == "action" || step.group == "strobe") &&
            step.outcome == StepOutcome::set)
            add(step.feature);
    add("ExposureAuto");
    if (!changes_itself(nodes, "ExposureAuto")) add(exposure_feature);
    return features;
}

/// Whether the camera has a clock of its own: without a tick frequency Aravis silently puts the
/// host's time in its place.
bool has_clock(ArvDevice* device) {
    GlibError error;
    return !ARV_IS_GV_DEVICE(device) ||
           arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(device), error.out()) != 0;
}

/// By itself, or because the service sets it while the camera streams.
bool exposure_changes(const AravisNodeMap& nodes, const CameraSetup& setup,
                      const CameraConfiguration& configuration) {
    return configuration.trigger != TriggerSource::free_run &&
           (configuration.auto_exposure.enabled ||
            fixed_exposure(nodes, setup.exposure_feature).ns == 0);
}

/// Nobody asked for them: a camera without them is witnessed by its register instead.
bool enable_chunks(AravisNodeMap& nodes, const CameraPreset& preset,
                   const CameraConfiguration& configuration, CameraSetup& setup) {
    PresetRun run(preset, nodes, variables_of(preset, configuration));
    run.carry_out("chunks");
    run.read_back();
    const auto done = run.verdict();
    if (done && !run.results().empty()) {
        setup.steps.insert(setup.steps.end(), run.results().begin(), run.results().end());
        return true;
    }
    log(LogLevel::info, configuration.name, "its frames do not carry their exposure time{}{}",
        done ? "" : ": ", done ? "" : done.error().message());
    static_cast<void>(nodes.set("ChunkModeActive", "false"));
    return false;
}

/// Names the camera in `setup`, and chooses its preset.
Expected<CameraPreset> identify(ArvCamera* camera, const std::string& preset,
                                const std::vector<CameraPreset>& presets, CameraSetup& setup) {
    setup.vendor = name_of(camera, arv_camera_get_vendor_name);
    setup.model = name_of(camera, arv_camera_get_model_name);
    setup.serial = name_of(camera, arv_camera_get_device_serial_number);
    auto chosen = choose_preset(presets, preset, setup.vendor, setup.model);
    if (chosen) setup.preset = chosen->name;
    return chosen;
}

}  // namespace

Expected<> set_up_camera(ArvCamera* camera, AravisNodeMap& nodes,
                         const CameraConfiguration& configuration,
                         const std::vector<CameraPreset>& presets, CameraSetup& setup) {
    const auto preset = identify(camera, configuration.preset, presets, setup);
    if (!preset) return Unexpected(preset.error());
    setup.stamp_instant = configuration.stamp_instant == pairing::Instant::unknown
                              ? preset->stamp_instant
                              : configuration.stamp_instant;
    setup.exposure_feature = nodes.first_of(preset->exposure_time);
    setup.chunk_exposure = first_chunk(nodes, preset->chunk_exposure);
    setup.chunk_exposure_unit_us = preset->chunk_exposure_unit_us;
    setup.sensor = {first_number(nodes, preset->gain), first_number(nodes, preset->temperature)};

    arv_camera_stop_acquisition(camera, nullptr);  // somebody may have left it running
    if (auto has_all = check_groups(*preset, configuration); !has_all) return has_all;
    PresetRun run(*preset, nodes, variables_of(*preset, configuration));
    for (const std::string& group : wanted_groups(configuration)) run.carry_out(group);
    // One whose rate cannot be set keeps its own, which is compared with the configured one.
    if (configuration.trigger == TriggerSource::free_run)
        arv_camera_set_frame_rate(camera, configuration.rate_hz, nullptr);
    setup.steps = run.results();
    if (auto good = run.verdict(); !good) return good;
    for (const auto& [name, value] : configuration.features)
        if (auto done = nodes.set(name, value); !done) return done;
    run.read_back();
    setup.steps = run.results();
    setup.lines = line_delays(*preset, configuration, run.variable("trigger_line"),
                              run.variable("strobe_line"));
    setup.watched = watched(nodes, setup.steps, setup.exposure_feature);
    if (auto good = run.verdict(); !good) return good;

    const std::string mode = nodes.read("ExposureMode");
    if (!mode.empty() && mode != "Timed") setup.exposure_feature.clear();  // pulses are as long
    setup.chunks = configuration.chunks ? *configuration.chunks
                                        : exposure_changes(nodes, setup, configuration) &&
                                              enable_chunks(nodes, *preset, configuration, setup);
    if (setup.chunks && has_set(setup.steps, preset->chunk_gain_selector))
        setup.chunk_gain = first_chunk(nodes, preset->chunk_gain);
    const auto payload = payload_of(camera, configuration);
    if (!payload) return Unexpected(payload.error());
    setup.payload = *payload;
    setup.has_clock = has_clock(arv_camera_get_device(camera));
    return {};
}

Duration fixed_exposure(const AravisNodeMap& nodes, const std::string& feature) {
    if (feature.empty() || changes_itself(nodes, "ExposureAuto")) return {};
    return {std::llround(nodes.read_number(feature).value_or(0) * 1e3)};
}

SensorState sensor_state(const AravisNodeMap& nodes, const SensorFeatures& features) {
    SensorState state;
    const auto read = [&](const std::string& feature, float& value) {
        const auto number = feature.empty() ? std::nullopt : nodes.read_number(feature);
        if (number) value = static_cast<float>(*number);
    };
    read(features.temperature, state.temperature_c);
    if (!changes_itself(nodes, "GainAuto")) read(features.gain, state.gain);
    return state;
}

}  // namespace versavis::daemon
