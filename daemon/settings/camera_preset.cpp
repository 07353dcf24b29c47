// SPDX-License-Identifier: BSD-3-Clause
#include "camera_preset.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

#include "base/lower_case.hpp"
#include "engine/toml/table_reader.hpp"

namespace versavis::daemon {

const std::vector<std::string> preset_groups{
    "default_settings", "known_state", "trigger", "strobe", "free_run", "fixed_exposure",
    "exposure_limit",   "pulse_width", "chunks",  "ptp",    "action"};

namespace {

/// True when `parts` is empty or one of them is in the text.
bool fits(const std::vector<std::string>& parts, const std::string& text) {
    return parts.empty() || std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
               return lower_case(text).find(lower_case(part)) != std::string::npos;
           });
}

std::optional<EdgeDelay> read_edge(TableReader& reader, std::string_view key) {
    std::vector<double> us;
    reader.read(key, us, 2, 0, slowest_edge_us);
    if (us.empty()) return std::nullopt;
    return EdgeDelay{from_us(us[0]), from_us(us[1])};
}

PresetLine read_line(TableReader& reader) {
    PresetLine line;
    reader.read("name", line.name);
    if (line.name.empty()) reader.fail("name", "a [[line]] needs a 'name'");
    reader.choose<LineKind>("kind", line.kind,
                            {{"opto", LineKind::opto}, {"direct", LineKind::direct}});
    if (!reader.has("kind"))
        reader.fail("kind", "a [[line]] needs a 'kind'", "\"opto\" or \"direct\"");
    line.input_rising = read_edge(reader, "input_rising_us");
    line.input_falling = read_edge(reader, "input_falling_us");
    line.output_rising = read_edge(reader, "output_rising_us");
    line.output_falling = read_edge(reader, "output_falling_us");
    return line;
}

/// Most microseconds that a unit of a chunk may have: a second.
constexpr double longest_unit_us = 1e6;

PresetStep read_step(TableReader& reader) {
    PresetStep step;
    reader.read("set", step.features);
    reader.read("to", step.values);
    reader.read("needed", step.needed);
    if (step.features.empty() || step.values.empty())
        reader.fail("set", "a step needs 'set' and 'to'", "give a list of names for each");
    return step;
}

/// Steps that share what is selected for them.
std::vector<PresetStep> read_steps(TomlFile& file, const toml::table& table) {
    TableReader reader(file, table);
    std::vector<std::string> selection;
    reader.read("select", selection);
    if (!selection.empty() && selection.size() != 2)
        reader.fail("select", "'select' needs a selector and its value");
    std::vector<PresetStep> steps;
    for (const toml::table* entry : reader.tables("steps")) {
        TableReader step_reader(file, *entry);
        steps.push_back(read_step(step_reader));
        step_reader.finish();
        if (selection.size() != 2) continue;
        steps.back().selector = selection[0];
        steps.back().selected = selection[1];
    }
    if (steps.empty()) reader.fail("steps", "'steps' is missing or empty", "give a list of them");
    reader.finish();
    return steps;
}

Expected<CameraPreset> load_preset(const std::filesystem::path& path) {
    const auto root = parse_toml(path.string());
    if (!root) return Unexpected(root.error());
    TomlFile file{path.string(), "man versavis.toml"};
    CameraPreset preset;
    preset.name = path.stem().string();
    TableReader reader(file, *root);
    reader.read("vendors", preset.vendors);
    reader.read("models", preset.models);
    reader.read("triggers", preset.triggers);
    reader.read("trigger_lines", preset.trigger_lines);
    reader.read("strobe_lines", preset.strobe_lines);
    reader.read("line_inverter", preset.line_inverter);
    reader.read("exposure_time", preset.exposure_time);
    reader.read("chunk_selector", preset.chunk_selector);
    reader.read("chunk_exposure", preset.chunk_exposure);
    reader.read("chunk_exposure_unit_us", preset.chunk_exposure_unit_us, 0, longest_unit_us);
    reader.read("gain", preset.gain);
    reader.read("temperature", preset.temperature);
    reader.read("chunk_gain_selector", preset.chunk_gain_selector);
    reader.read("chunk_gain", preset.chunk_gain);
    reader.choose<pairing::Instant>("stamp_instant", preset.stamp_instant,
                                    {{"start", pairing::Instant::start},
                                     {"middle", pairing::Instant::middle},
                                     {"end", pairing::Instant::end}});
    for (const toml::table* table : reader.tables("line")) {
        TableReader line_reader(file, *table);
        preset.lines.push_back(read_line(line_reader));
        line_reader.finish();
    }
    for (const std::string& group : preset_groups) {
        if (reader.has(group)) preset.groups[group];  // an empty one is stated, too
        for (const toml::table* table : reader.tables(group))
            for (PresetStep& step : read_steps(file, *table))
                preset.groups[group].push_back(std::move(step));
    }
    reader.finish();
    if (auto read = file.result(); !read) return Unexpected(read.error());
    return preset;
}

/// The directory's own, or that of this program.
Expected<CameraPreset> load_base(const std::filesystem::path& directory) {
    const std::string file = base_preset + ".toml";
    const bool own = std::filesystem::exists(directory / file);
    return load_preset((own ? directory : default_preset_directory()) / file);
}

/// What the preset does not state is as in the base.
void complete(CameraPreset& preset, const CameraPreset& base) {
    const auto inherit = [](auto& own, const auto& inherited) {
        if (own.empty()) own = inherited;
    };
    inherit(preset.triggers, base.triggers);
    inherit(preset.trigger_lines, base.trigger_lines);
    inherit(preset.strobe_lines, base.strobe_lines);
    inherit(preset.exposure_time, base.exposure_time);
    inherit(preset.chunk_selector, base.chunk_selector);
    inherit(preset.chunk_exposure, base.chunk_exposure);
    inherit(preset.gain, base.gain);
    inherit(preset.temperature, base.temperature);
    inherit(preset.chunk_gain_selector, base.chunk_gain_selector);
    inherit(preset.chunk_gain, base.chunk_gain);
    preset.groups.insert(base.groups.begin(), base.groups.end());
}

}  // namespace

std::filesystem::path preset_directory(const Configuration& configuration) {
    const std::filesystem::path own = configuration.preset_directory;
    return own.empty() ? default_preset_directory() : own;
}

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
        return failure(directory.string(), "there are no camera presets in this directory",
                       "install them, or set 'preset_directory' in the configuration");
    const auto base = load_base(directory);
    if (!base) return Unexpected(base.error());
    for (CameraPreset& preset : presets) complete(preset, *base);
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

}  // namespace versavis::daemon
