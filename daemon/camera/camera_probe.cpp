// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_probe.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>

#include "base/lower_case.hpp"
#include "camera/camera_discovery.hpp"

namespace versavis::daemon {

namespace {

using nlohmann::json;

/// Features that a description may name in its categories, for the report.
constexpr std::size_t most_features = 5000;

bool never() { return false; }

/// Names of the features below a category, each once.
void collect(ArvDevice* device, const std::string& name, std::vector<std::string>& names) {
    ArvGcNode* node = arv_device_get_feature(device, name.c_str());
    if (!ARV_IS_GC_CATEGORY(node)) {
        if (node != nullptr && names.size() < most_features &&
            std::find(names.begin(), names.end(), name) == names.end())
            names.push_back(name);
        return;
    }
    for (const GSList* entry = arv_gc_category_get_features(ARV_GC_CATEGORY(node));
         entry != nullptr; entry = entry->next)
        if (const char* child = static_cast<const char*>(entry->data); child != name)
            collect(device, child, names);
}

/// The value, and for an enumeration what else this model offers.
std::string value_of(const AravisNodeMap& nodes, const std::string& feature) {
    const auto values = nodes.values(feature);
    return values.empty() ? nodes.read(feature)
                          : fmt::format("{} of {}", nodes.read(feature), fmt::join(values, ", "));
}

std::string value_in(const ProbeReport& report, const std::string& feature) {
    const auto found = std::find_if(report.features.begin(), report.features.end(),
                                    [&](const auto& entry) { return entry.first == feature; });
    return found == report.features.end() ? "" : found->second;
}

void set_up(ArvCamera* camera, const CameraConfiguration& configuration,
            const std::vector<CameraPreset>& presets, bool features, ProbeReport& report) {
    AravisNodeMap nodes(arv_camera_get_device(camera));
    if (const auto done = set_up_camera(camera, nodes, configuration, presets, report.setup);
        !done) {
        report.state = CameraState::misconfigured;
        report.problem = done.error().message();
    }
    if (!features) return;
    std::size_t size = 0;
    const char* xml = arv_device_get_genicam_xml(nodes.device(), &size);
    report.description.assign(xml == nullptr ? "" : xml, size);
    std::vector<std::string> names;
    collect(nodes.device(), "Root", names);
    for (const std::string& name : names)
        if (nodes.available(name)) report.features.emplace_back(name, value_of(nodes, name));
}

json step_object(const StepResult& step) {
    return {{"group", step.group},   {"node", step.node()},   {"wanted", step.wanted},
            {"actual", step.actual}, {"needed", step.needed}, {"outcome", to_string(step.outcome)},
            {"reason", step.reason}};
}

}  // namespace

ProbeReport probe_camera(const CameraConfiguration& configuration,
                         const std::filesystem::path& preset_directory, bool features) {
    ProbeReport report;
    report.device = configuration.device;
    const auto presets = load_presets(preset_directory);
    if (!presets) {
        report.state = CameraState::failed;
        report.problem = presets.error().message();
        return report;
    }
    DescriptionSandbox descriptions(own_program, "/dev/null");  // nothing is kept
    DeviceLocks claims;
    std::timed_mutex aravis;
    auto opened = open_camera(configuration.name, configuration.device,
                              {descriptions, claims, aravis}, never);
    if (!opened) {
        report.state = opened.error().state;
        report.problem = opened.error().error.message();
        return report;
    }
    set_up(opened->camera.get(), configuration, *presets, features, report);
    return report;
}

std::string to_text(const ProbeReport& report) {
    std::string text = fmt::format("{}: {} {} (serial number {})\n  preset {}\n", report.device,
                                   report.setup.vendor, report.setup.model, report.setup.serial,
                                   report.setup.preset);
    if (report.setup.preset.empty()) text = report.device + ":\n";
    for (const StepResult& step : report.setup.steps) {
        if (step.outcome == StepOutcome::set && !step.actual.empty())
            text += fmt::format("  {:<44} {}\n", step.node(), step.actual);
        else if (step.outcome == StepOutcome::differs || step.outcome == StepOutcome::refused ||
                 (step.needed && step.outcome == StepOutcome::left_out))
            text += fmt::format("  {:<44} {}: {}\n", step.node(),
                                step.needed ? "NEEDED, not set" : "not set", step.reason);
    }
    if (!report.setup.lines.line.empty())
        text += fmt::format(
            "  delays of {}: start {:.2f} us, end {:.2f} us, sigma of the middle {:.2f} us ({})\n",
            report.setup.lines.line, static_cast<double>(report.setup.lines.start.delay.ns) * 1e-3,
            static_cast<double>(report.setup.lines.end.delay.ns) * 1e-3,
            static_cast<double>(middle_sigma(report.setup.lines).ns) * 1e-3,
            to_string(report.setup.lines.source));
    return text + (report.problem.empty()
                       ? "  ready\n"
                       : fmt::format("  {}: {}\n", to_string(report.state), report.problem));
}

std::string to_json(const ProbeReport& report) {
    json steps = json::array();
    for (const StepResult& step : report.setup.steps) steps.push_back(step_object(step));
    json features = json::object();
    for (const auto& [name, value] : report.features) features[name] = value;
    json object{{"device", report.device},
                {"state", to_string(report.state)},
                {"problem", report.problem.empty() ? json(nullptr) : json(report.problem)},
                {"vendor", report.setup.vendor},
                {"model", report.setup.model},
                {"serial", report.setup.serial},
                {"preset", report.setup.preset},
                {"setup", steps}};
    if (!report.features.empty()) {
        object["features"] = features;
        object["description"] = report.description;
        object["draft_preset"] = draft_preset(report);
    }
    // Names from devices may hold anything; what is no UTF-8 is replaced.
    return object.dump(2, ' ', false, json::error_handler_t::replace);
}

std::string draft_preset(const ProbeReport& report) {
    return fmt::format(
        "# SPDX-License-Identifier: BSD-3-Clause\n"
        "# Draft from a {} {}. This camera offers, with what is selected now:\n"
        "# TriggerSelector: {}\n# TriggerSource: {}\n# LineSelector: {}\n# LineMode: {}\n"
        "# LineSource: {}\n"
        "vendors = [\"{}\"]\n"
        "trigger_lines = [\"\"]  # of TriggerSource: where the board's trigger is wired to\n"
        "strobe_lines = [\"\"]  # of LineSelector: where the exposure comes out\n",
        report.setup.vendor, report.setup.model, value_in(report, "TriggerSelector"),
        value_in(report, "TriggerSource"), value_in(report, "LineSelector"),
        value_in(report, "LineMode"), value_in(report, "LineSource"),
        lower_case(report.setup.vendor));
}

}  // namespace versavis::daemon
