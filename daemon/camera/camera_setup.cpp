// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

class DeviceBook final : public FeatureBook {
 public:
    explicit DeviceBook(ArvDevice* device) : device_(device) {}
    bool has(const std::string& feature) const override { return has_feature(device_, feature); }
    std::vector<std::string> entries(const std::string& feature) const override {
        return enumeration_entries(device_, feature);
    }

 private:
    ArvDevice* device_;
};

std::string text(const char* value) { return value == nullptr ? "" : value; }

/// Groups of the preset, in the order that cameras need: the trigger mode last, then the output
/// lines.
std::vector<std::string> wanted_groups(const CameraConfiguration& configuration) {
    std::vector<std::string> groups;
    if (configuration.chunks) groups.emplace_back("chunks");
    if (configuration.ptp) groups.emplace_back("ptp");
    if (configuration.auto_exposure.enabled) groups.emplace_back("fixed_exposure");
    if (configuration.trigger == TriggerSource::free_run) {
        groups.emplace_back("free_run");
        return groups;
    }
    if (!configuration.auto_exposure.enabled) groups.emplace_back("exposure_limit");
    groups.emplace_back("trigger");
    if (configuration.exposure_by_pulse) groups.emplace_back("pulse_width");
    if (configuration.strobe != Strobe::none) groups.emplace_back("strobe");
    return groups;
}

Expected<std::vector<PresetAction>> plan_all(const CameraPreset& preset,
                                             const CameraConfiguration& configuration,
                                             ArvDevice* device) {
    const auto line = [](const std::string& own, const std::string& usual) {
        return own.empty() ? usual : own;
    };
    const std::map<std::string, std::string> variables{
        {"trigger_line", line(configuration.trigger_line, preset.trigger_line)},
        {"strobe_line", line(configuration.strobe_line, preset.strobe_line)},
        {"max_exposure_us", fmt::format("{:.0f}", std::floor(configuration.max_exposure_us))},
        {"edge", configuration.trigger_inverted ? "FallingEdge" : "RisingEdge"}};
    std::vector<PresetAction> actions;
    for (const std::string& group : wanted_groups(configuration)) {
        const auto steps = preset.groups.find(group);
        const bool asked_for = group == "chunks" || group == "ptp" || group == "pulse_width";
        if (steps == preset.groups.end() && asked_for)
            return failure(fmt::format("preset {}", preset.name),
                           fmt::format("these cameras have no '{}'", group),
                           "remove the key that asks for it, or set the features by name");
        auto planned = plan(preset, group, variables, DeviceBook(device));
        if (!planned) return planned;
        actions.insert(actions.end(), planned->begin(), planned->end());
    }
    return actions;
}

Expected<> carry_out(ArvDevice* device, const std::vector<PresetAction>& actions) {
    for (const PresetAction& action : actions)
        if (auto done = set_feature(device, action.feature, action.value);
            !done && !action.optional)
            return done;
    return {};
}

}  // namespace

Expected<CameraSetup> set_up_camera(ArvCamera* camera, const CameraConfiguration& configuration,
                                    const std::vector<CameraPreset>& presets) {
    ArvDevice* device = arv_camera_get_device(camera);
    CameraSetup setup;
    setup.vendor = text(arv_camera_get_vendor_name(camera, nullptr));
    setup.model = text(arv_camera_get_model_name(camera, nullptr));
    setup.serial = text(arv_camera_get_device_serial_number(camera, nullptr));
    auto preset = choose_preset(presets, configuration.preset, setup.vendor, setup.model);
    if (!preset) return Unexpected(preset.error());
    setup.preset = preset->name;
    const auto exposure =
        std::find_if(preset->exposure_time.begin(), preset->exposure_time.end(),
                     [&](const std::string& name) { return has_feature(device, name); });
    if (exposure != preset->exposure_time.end()) setup.exposure_feature = *exposure;
    const auto actions = plan_all(*preset, configuration, device);
    if (!actions) return Unexpected(actions.error());

    arv_camera_stop_acquisition(camera, nullptr);  // somebody may have left it running
    set_if_available(device, "AcquisitionMode", "Continuous");
    if (auto done = carry_out(device, *actions); !done) return Unexpected(done.error());
    // One that cannot be told its rate keeps its own, and is held against the configured one.
    if (configuration.trigger == TriggerSource::free_run)
        arv_camera_set_frame_rate(camera, configuration.rate_hz, nullptr);
    for (const auto& [name, value] : configuration.features)
        if (auto done = set_feature(device, name, value); !done) return Unexpected(done.error());

    setup.chunks = configuration.chunks;
    setup.payload = arv_camera_get_payload(camera, nullptr);
    if (setup.payload == 0)
        return failure(configuration.name, "the camera does not say how large its frames are",
                       "power it off and on");
    // Without a tick frequency Aravis silently puts the host's time in the place of the camera's.
    setup.has_clock = !ARV_IS_GV_DEVICE(device) || arv_gv_device_get_timestamp_tick_frequency(
                                                       ARV_GV_DEVICE(device), nullptr) != 0;
    return setup;
}

Duration fixed_exposure(ArvDevice* device, const CameraSetup& setup) {
    const std::string automatic = read_text(device, "ExposureAuto");
    const std::string mode = read_text(device, "ExposureMode");
    const bool fixed =
        (automatic.empty() || automatic == "Off") && (mode.empty() || mode == "Timed");
    if (!fixed || setup.exposure_feature.empty()) return {};
    return {std::llround(read_number(device, setup.exposure_feature).value_or(0) * 1e3)};
}

}  // namespace versavis::daemon
