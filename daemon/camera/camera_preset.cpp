// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_preset.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

#include "engine/toml/table_reader.hpp"

namespace versavis::daemon {

const std::vector<std::string> preset_groups{
    "trigger",        "strobe",      "free_run", "fixed_exposure",
    "exposure_limit", "pulse_width", "chunks",   "ptp"};

namespace {

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return std::tolower(c); });
    return text;
}

/// True when `parts` is empty or one of them is in the text.
bool fits(const std::vector<std::string>& parts, const std::string& text) {
    return parts.empty() || std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
               return lower(text).find(lower(part)) != std::string::npos;
           });
}

/// Slowest edge of a line that a preset may state. At half, the slowest known lines still fit; at
/// twice, a figure in nanoseconds by mistake is taken for microseconds more often.
constexpr double slowest_edge_us = 1000;

std::optional<EdgeDelay> read_edge(TableReader& reader, std::string_view key) {
    std::vector<double> us;
    reader.read(key, us, 2, 0, slowest_edge_us);
    if (us.empty()) return std::nullopt;
    return EdgeDelay{from_us(us[0]), from_us(us[1])};
}

PresetLine read_line(TableReader& reader) {
    PresetLine line;
    reader.read("name", line.name);
    if (line.name.empty()) reader.fail("name", "a line needs a 'name'");
    reader.choose<LineKind>("kind", line.kind,
                            {{"opto", LineKind::opto}, {"direct", LineKind::direct}});
    if (!reader.has("kind")) reader.fail("kind", "a line needs a 'kind'", "\"opto\" or \"direct\"");
    line.input_rising = read_edge(reader, "input_rising_us");
    line.input_falling = read_edge(reader, "input_falling_us");
    line.output_rising = read_edge(reader, "output_rising_us");
    line.output_falling = read_edge(reader, "output_falling_us");
    return line;
}

Expected<CameraPreset> load_preset(const std::filesystem::path& path) {
    const auto root = parse_toml(path.string());
    if (!root) return Unexpected(root.error());
    TomlFile file{path.string(), "docs/user/cameras.md"};
    CameraPreset preset;
    preset.name = path.stem().string();
    TableReader reader(file, *root);
    reader.read("vendors", preset.vendors);
    reader.read("models", preset.models);
    reader.read("trigger_line", preset.trigger_line);
    reader.read("strobe_line", preset.strobe_line);
    reader.read("exposure_time", preset.exposure_time);
    reader.choose<pairing::Instant>("stamp_instant", preset.stamp_instant,
                                    {{"start", pairing::Instant::start},
                                     {"middle", pairing::Instant::middle},
                                     {"end", pairing::Instant::end}});
    for (const toml::table* table : reader.tables("line")) {
        TableReader line_reader(file, *table);
        preset.lines.push_back(read_line(line_reader));
        line_reader.finish();
    }
    for (const std::string& group : preset_groups)
        for (const toml::table* table : reader.tables(group)) {
            TableReader step_reader(file, *table);
            PresetStep step;
            step_reader.read("set", step.features);
            step_reader.read("to", step.values);
            step_reader.read("optional", step.optional);
            if (step.features.empty() || step.values.empty())
                step_reader.fail("set", "a step needs 'set' and 'to'",
                                 "give a list of names for each");
            step_reader.finish();
            preset.groups[group].push_back(std::move(step));
        }
    reader.finish();
    if (auto read = file.result(); !read) return Unexpected(read.error());
    return preset;
}

std::string filled(std::string text, const std::map<std::string, std::string>& variables) {
    for (const auto& [name, value] : variables) {
        const std::string mark = "{" + name + "}";
        if (const auto at = text.find(mark); at != std::string::npos)
            text.replace(at, mark.size(), value);
    }
    return text;
}

std::optional<std::string> first_feature(const PresetStep& step, const FeatureBook& camera) {
    const auto found =
        std::find_if(step.features.begin(), step.features.end(),
                     [&](const std::string& feature) { return camera.has(feature); });
    return found == step.features.end() ? std::nullopt : std::optional(*found);
}

/// The first value that an enumeration has; any other feature takes the first.
std::optional<std::string> first_value(const PresetStep& step, const std::string& feature,
                                       const std::map<std::string, std::string>& variables,
                                       const FeatureBook& camera) {
    const auto entries = camera.entries(feature);
    for (const std::string& value : step.values) {
        const std::string text = filled(value, variables);
        if (entries.empty() || std::find(entries.begin(), entries.end(), text) != entries.end())
            return text;
    }
    return std::nullopt;
}

}  // namespace

std::filesystem::path default_preset_directory() {
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
    return program.parent_path().parent_path() / "share/versavis/presets";
}

Expected<std::vector<CameraPreset>> load_presets(const std::filesystem::path& directory) {
    std::vector<CameraPreset> presets;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
        if (entry.path().extension() != ".toml") continue;
        auto preset = load_preset(entry.path());
        if (!preset) return Unexpected(preset.error());
        presets.push_back(std::move(*preset));
    }
    if (presets.empty())
        return failure(directory.string(), "there are no camera presets",
                       "install them, or set 'preset_directory' in the configuration");
    // By vendor and model first, then by vendor, then for any; among equals by name.
    std::sort(presets.begin(), presets.end(), [](const CameraPreset& a, const CameraPreset& b) {
        const auto rank = [](const CameraPreset& p) {
            return (p.vendors.empty() ? 2 : 0) + (p.models.empty() ? 1 : 0);
        };
        return std::make_pair(rank(a), a.name) < std::make_pair(rank(b), b.name);
    });
    return presets;
}

Expected<CameraPreset> choose_preset(const std::vector<CameraPreset>& presets,
                                     const std::string& name, const std::string& vendor,
                                     const std::string& model) {
    const auto found =
        std::find_if(presets.begin(), presets.end(), [&](const CameraPreset& preset) {
            return name == "auto" ? fits(preset.vendors, vendor) && fits(preset.models, model)
                                  : preset.name == name;
        });
    if (found != presets.end()) return *found;
    std::vector<std::string> names;
    for (const CameraPreset& preset : presets) names.push_back(preset.name);
    return failure(
        "preset",
        fmt::format("there is no preset '{}' for this camera ({} {})", name, vendor, model),
        fmt::format("use one of: auto, {}", fmt::join(names, ", ")));
}

Expected<std::vector<PresetAction>> plan(const CameraPreset& preset, const std::string& group,
                                         const std::map<std::string, std::string>& variables,
                                         const FeatureBook& camera) {
    std::vector<PresetAction> actions;
    std::vector<std::string> problems;
    const auto steps = preset.groups.find(group);
    if (steps == preset.groups.end()) return actions;
    for (const PresetStep& step : steps->second) {
        const auto feature = first_feature(step, camera);
        const auto value = feature ? first_value(step, *feature, variables, camera) : std::nullopt;
        if (value)
            actions.push_back({*feature, *value, step.optional});
        else if (!step.optional && !feature)
            problems.push_back(fmt::format("it has no {}", fmt::join(step.features, " or ")));
        else if (!step.optional)
            problems.push_back(fmt::format("{} knows only {}", *feature,
                                           fmt::join(camera.entries(*feature), ", ")));
    }
    if (problems.empty()) return actions;
    return failure(
        fmt::format("preset {}, {}", preset.name, group),
        fmt::format("does not fit this camera: {}", fmt::join(problems, "; ")),
        "set 'trigger_line' and 'strobe_line', another 'preset', or the features by name");
}

}  // namespace versavis::daemon
