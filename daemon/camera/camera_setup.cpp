// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace versavis::daemon {

namespace {

/// Letters of a name that are looked at; GigE Vision knows 32. At half, long names are cut; at
/// twice, nothing changes.
constexpr std::size_t longest_name = 256;

/// The largest frame. At half, the largest sensors of 2020 would be refused with 16 bits; at twice,
/// a camera that lies takes twice the memory, for each slot.
constexpr std::uint64_t largest_frame = 256 << 20;

/// Bytes that a pixel may take: three colours of 16 bits, and padding. At half, colour images would
/// be refused; at twice, twice the memory for a camera that lies.
constexpr std::uint64_t most_bytes_per_pixel = 8;

/// What may follow the pixels, such as chunks. At half, still thousands of them; at twice, a MiB
/// more for a camera that lies.
constexpr std::uint64_t largest_extra = 1 << 20;

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

/// What the camera says of itself; empty when it does not.
std::string name_of(ArvCamera* camera, const char* (*get)(ArvCamera*, GError**)) {
    GlibError error;
    const char* value = get(camera, error.out());
    return error.set() || value == nullptr ? "" : std::string(value, strnlen(value, longest_name));
}

/// Bytes of a frame with all that may follow the pixels. Errors: it does not say, or what it says
/// cannot be for images of its size.
Expected<std::uint64_t> payload_of(ArvCamera* camera, const CameraConfiguration& configuration) {
    GlibError error;
    // As 64 bits: arv_camera_get_payload() cuts off half of them.
    const gint64 announced = arv_device_get_integer_feature_value(arv_camera_get_device(camera),
                                                                  "PayloadSize", error.out());
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
    if (payload <= most) return payload;
    return failure(configuration.name,
                   fmt::format("the camera announces frames of {} bytes for {} x {} pixels, more "
                               "than {}",
                               payload, width, height, most),
                   "set Width, Height and PixelFormat in [camera.features], or power it off and "
                   "on");
}

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

std::string own_or(const std::string& own, const std::string& usual) {
    return own.empty() ? usual : own;
}

/// The exposure output that the camera has, which is selected last.
std::string strobe_line(const CameraPreset& preset, const CameraConfiguration& configuration,
                        const std::vector<PresetAction>& actions) {
    std::string line = own_or(configuration.strobe_line, preset.strobe_line);
    for (const PresetAction& action : actions)
        if (action.feature == "LineSelector") line = action.value;
    return line;
}

Expected<std::vector<PresetAction>> plan_all(const CameraPreset& preset,
                                             const CameraConfiguration& configuration,
                                             ArvDevice* device) {
    const std::map<std::string, std::string> variables{
        {"trigger_line", own_or(configuration.trigger_line, preset.trigger_line)},
        {"strobe_line", own_or(configuration.strobe_line, preset.strobe_line)},
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
    setup.vendor = name_of(camera, arv_camera_get_vendor_name);
    setup.model = name_of(camera, arv_camera_get_model_name);
    setup.serial = name_of(camera, arv_camera_get_device_serial_number);
    auto preset = choose_preset(presets, configuration.preset, setup.vendor, setup.model);
    if (!preset) return Unexpected(preset.error());
    setup.preset = preset->name;
    setup.stamp_instant = configuration.stamp_instant == pairing::Instant::unknown
                              ? preset->stamp_instant
                              : configuration.stamp_instant;
    const auto exposure =
        std::find_if(preset->exposure_time.begin(), preset->exposure_time.end(),
                     [&](const std::string& name) { return has_feature(device, name); });
    if (exposure != preset->exposure_time.end()) setup.exposure_feature = *exposure;
    const auto actions = plan_all(*preset, configuration, device);
    if (!actions) return Unexpected(actions.error());
    setup.lines = line_delays(*preset, configuration,
                              own_or(configuration.trigger_line, preset->trigger_line),
                              strobe_line(*preset, configuration, *actions));

    arv_camera_stop_acquisition(camera, nullptr);  // somebody may have left it running
    set_if_available(device, "AcquisitionMode", "Continuous");
    if (auto done = carry_out(device, *actions); !done) return Unexpected(done.error());
    // One that cannot be told its rate keeps its own, and is held against the configured one.
    if (configuration.trigger == TriggerSource::free_run)
        arv_camera_set_frame_rate(camera, configuration.rate_hz, nullptr);
    for (const auto& [name, value] : configuration.features)
        if (auto done = set_feature(device, name, value); !done) return Unexpected(done.error());

    setup.chunks = configuration.chunks;
    const auto payload = payload_of(camera, configuration);
    if (!payload) return Unexpected(payload.error());
    setup.payload = *payload;
    // Without a tick frequency Aravis silently puts the host's time in the place of the camera's.
    GlibError error;
    setup.has_clock = !ARV_IS_GV_DEVICE(device) || arv_gv_device_get_timestamp_tick_frequency(
                                                       ARV_GV_DEVICE(device), error.out()) != 0;
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
