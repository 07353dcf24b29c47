// SPDX-License-Identifier: BSD-3-Clause
#include "configuration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>
#include <utility>

#include "configuration_check.hpp"
#include "configuration_file.hpp"
#include "engine/toml/service_file.hpp"
#include "engine/toml/table_reader.hpp"
#include "keys.hpp"

namespace versavis::daemon {

namespace {

/// How long complete frames wait behind one that lost packets.
constexpr double longest_wait_s = 0.12;

/// Trigger pulses, where the period leaves room for them: half of what it may be.
constexpr double usual_part_of_period = 0.25;

const std::string top_of_file = "the top of the file";

/// The tables that have this key, as documents call them; empty: none has it.
std::string tables_with(std::string_view key) {
    std::vector<std::string> tables;
    for (const KeyDescription& known : describe_keys())
        if (known.key == key) tables.push_back(known.table.empty() ? top_of_file : known.table);
    return fmt::format("{}", fmt::join(tables, " or "));
}

std::string move_to(const std::string& tables) {
    return fmt::format("move it there, above the {} table",
                       tables == top_of_file ? "first" : "next");
}

/// TOML takes each key as one of the table above it, whatever was meant.
std::string cure_of_stray(std::string_view title, std::string_view key) {
    const bool of_camera = title.find("camera") != std::string_view::npos;
    if (of_camera && std::isupper(static_cast<unsigned char>(key.front())) != 0)
        return "features of the camera go below [camera.features]";
    const std::string tables = tables_with(key);
    if (tables.empty()) return "";
    return fmt::format("it belongs to {}: {}", tables, move_to(tables));
}

/// Features that the service sets, with the key that says what to.
const std::pair<std::string_view, const char*> own_features[]{
    {"TriggerMode", "trigger"},
    {"TriggerSource", "trigger_line"},
    {"TriggerActivation", "trigger_inverted"},
    {"ExposureMode", "exposure"}};

/// What is below [camera.features] and belongs above it, or contradicts what is there.
void check_feature_name(TableReader& reader, const TableReader& camera_keys, std::string_view key,
                        const CameraConfiguration& camera) {
    if (camera_keys.knows(key))
        return reader.fail(key, fmt::format("'{}' is a key of the camera, not a feature", key),
                           "move it above [camera.features]");
    if (const std::string tables = tables_with(key); !tables.empty())
        return reader.fail(key, fmt::format("'{}' belongs to {}, it is no feature", key, tables),
                           move_to(tables));
    for (const auto& [feature, own] : own_features)
        if (key == feature && camera.trigger != TriggerSource::free_run)
            reader.fail(key, fmt::format("'{}' is set by the service, from '{}'", key, own),
                        fmt::format("set '{}' of the camera instead", own));
}

void read_features(TableReader& reader, const TableReader& camera_keys,
                   CameraConfiguration& camera) {
    for (const auto& [key, node] : reader.contents()) {
        check_feature_name(reader, camera_keys, key.str(), camera);
        std::ostringstream text;
        if (const auto* string = node.as_string())
            text << string->get();
        else if (node.is_boolean() || std::isfinite(node.value<double>().value_or(NAN)))
            text << toml::node_view(node);
        else
            reader.fail(key.str(),
                        fmt::format("feature '{}' must be a string, a number, true or false",
                                    clipped(key.str())));
        camera.features.emplace_back(key.str(), text.str());
    }
    camera.features_entry = reader.entry();
}

void read_tables_below(TableReader& reader, CameraConfiguration& camera) {
    if (auto keys = reader.below("auto_exposure", "[camera.auto_exposure]")) {
        camera.auto_exposure.enabled = true;
        read_keys(*keys, camera.auto_exposure);
        keys->finish();
        camera.auto_exposure.entry = keys->entry();
    }
    if (auto features = reader.below("features", "[camera.features]"))
        read_features(*features, reader, camera);
}

void read_tables_below(TableReader& /*reader*/, ImuConfiguration& /*imu*/) {}

void read_tables_below(TableReader& /*reader*/, TimeOutputConfiguration& /*output*/) {}

/// What follows from other keys where a key is not there.
void complete(CameraConfiguration& camera) {
    const auto open = [&](const char* key) { return !camera.entry.has(key); };
    const double period_us = 1e6 / camera.rate_hz;
    if (camera.max_exposure_us == 0) camera.max_exposure_us = period_us;
    if (open("pulse_us"))
        camera.pulse_us = std::min(camera.pulse_us, period_us * usual_part_of_period);
    if (open("exposure_us"))
        camera.exposure_us = std::clamp(period_us - camera.latency_us - camera.gap_us, 0.0,
                                        std::min(camera.exposure_us, camera.max_exposure_us));
    if (open("latest_arrival_ms"))
        camera.latest_arrival_ms = std::min(camera.latest_arrival_ms, longest_arrival_ms(camera));
    if (open("slots")) {
        const auto frames = [&](double seconds) {
            return static_cast<unsigned>(std::ceil(camera.rate_hz * seconds));
        };
        camera.slots = std::min(camera.buffers + spare_slots + frames(longest_wait_s), 1024U) +
                       frames(camera.history_s);
    }
    AutoExposureConfiguration& control = camera.auto_exposure;
    if (!control.entry.has("max_us")) control.max_us = camera.max_exposure_us;
    if (!control.entry.has("min_us")) control.min_us = std::min(control.min_us, control.max_us);
}

/// A slave has rate, phase and longest exposure of its master.
void complete(Configuration& configuration) {
    for (CameraConfiguration& camera : configuration.cameras) {
        camera.board_input_ns = configuration.board.input_delay_ns[camera.output];
        camera.board_output_ns = configuration.board.output_delay_ns[camera.output];
        if (configuration.clock.align) camera.grid_slew_ppm = configuration.clock.max_slew_ppm;
        if (configuration.ports.follow_sync)
            camera.grid_slew_ppm =
                wire::limits::sync_slew_ppm + wire::limits::largest_sync_pace_ppm;
        if (camera.master.empty()) complete(camera);
    }
    for (CameraConfiguration& camera : configuration.cameras) {
        if (camera.master.empty()) continue;
        if (const CameraConfiguration* master =
                find_triggered_camera(configuration, camera.master)) {
            camera.rate_hz = master->rate_hz;
            camera.phase_us = master->phase_us;
            camera.max_exposure_us = master->max_exposure_us;
        }
        complete(camera);
    }
}

/// Pulses that leave room for a pause, where nothing is said of their width.
void complete_ports(Configuration& configuration) {
    PortConfiguration& ports = configuration.ports;
    const double rate_hz = test_pulse_rate_hz(configuration);
    if (rate_hz > 0 && !ports.entry.has("pulse_us"))
        ports.pulse_us = std::min(ports.pulse_us, 1e6 / rate_hz * usual_part_of_period);
}

/// One table of the file, if it is there.
template <class Part>
void read_part(TableReader& top, const char* name, Part& part) {
    auto reader = top.below(name, fmt::format("[{}]", name));
    if (!reader) return;
    read_keys(*reader, part);
    reader->finish();
    part.entry = reader->entry();
}

/// All tables of an array.
template <class Part>
void read_parts(TomlFile& file, TableReader& top, const char* name, std::vector<Part>& parts) {
    for (const toml::table* table : top.tables(name)) {
        const std::string own_name = (*table)["name"].value_or(std::string());
        TableReader reader(file, *table,
                           own_name.empty()
                               ? fmt::format("[[{}]]", name)
                               : fmt::format("[[{}]] \"{}\"", name, clipped(own_name)));
        Part& part = parts.emplace_back();
        read_keys(reader, part);
        read_tables_below(reader, part);
        reader.finish();
        part.entry = reader.entry();
    }
}

}  // namespace

Expected<Configuration, TomlProblems> load_configuration(const std::string& path) {
    auto root = parse_service_file(path);
    if (!root) return Unexpected(std::move(root.error()));
    return read_configuration(*root, path);
}

Expected<Configuration, TomlProblems> read_configuration(const toml::table& root,
                                                         const std::string& path) {
    TomlFile file{path, "man versavis.toml", {}, cure_of_stray};
    Configuration configuration;
    TableReader top(file, root);
    read_keys(top, configuration);
    read_part(top, "board", configuration.board);
    read_part(top, "clock", configuration.clock);
    read_parts(file, top, "camera", configuration.cameras);
    read_parts(file, top, "imu", configuration.imus);
    read_part(top, "illumination", configuration.illumination);
    read_part(top, "ports", configuration.ports);
    read_parts(file, top, "time_output", configuration.time_outputs);
    read_part(top, "memory", configuration.memory);
    top.finish();
    configuration.entry = top.entry();
    complete(configuration);
    complete_ports(configuration);
    add_problems(configuration, file.problems);
    if (!file.problems.empty()) return Unexpected(std::move(file.problems));
    return configuration;
}

const CameraConfiguration* find_triggered_camera(const Configuration& configuration,
                                                 const std::string& name) {
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.name == name && camera.trigger == TriggerSource::board) return &camera;
    return nullptr;
}

const CameraConfiguration* find_camera_at(const Configuration& configuration, std::int64_t output) {
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.trigger == TriggerSource::board && camera.output == output) return &camera;
    return nullptr;
}

const ImuConfiguration* find_imu_at(const Configuration& configuration, std::int64_t port) {
    for (const ImuConfiguration& imu : configuration.imus)
        if (imu.port() == port) return &imu;
    return nullptr;
}

std::optional<std::uint8_t> test_source(const Configuration& configuration) {
    if (configuration.ports.test.empty())
        return std::uint8_t{configuration.ports.test_rate_hz > 0 ? wire::test_rate
                                                                 : wire::test_none};
    if (const CameraConfiguration* camera =
            find_triggered_camera(configuration, configuration.ports.test))
        return static_cast<std::uint8_t>(wire::test_camera0 + camera->output);
    for (const ImuConfiguration& imu : configuration.imus)
        if (imu.name == configuration.ports.test)
            return static_cast<std::uint8_t>(wire::test_imu0 + imu.port());
    return std::nullopt;
}

const std::string& output_name(std::uint8_t test_output) {
    return std::find_if(test_outputs.begin(), test_outputs.end(),
                        [&](const auto& known) { return known.second == test_output; })
        ->first;
}

double test_pulse_rate_hz(const Configuration& configuration) {
    const std::string& test = configuration.ports.test;
    if (test.empty()) return configuration.ports.test_rate_hz;
    if (const auto* camera = find_triggered_camera(configuration, test)) return camera->rate_hz;
    for (const ImuConfiguration& imu : configuration.imus)
        if (imu.name == test) return imu.rate_hz;
    return 0;
}

imu::FilterDelay ImuConfiguration::filter_delay() const {
    if (filter_delay_us)
        return imu::measured_delay(*model, rate_hz, data_ready, from_us(*filter_delay_us));
    return imu::filter_delay(*model, filter, rate_hz, data_ready);
}

Duration from_us(double us) { return {std::llround(us * 1e3)}; }

Duration period_of(const CameraConfiguration& camera) { return from_us(1e6 / camera.rate_hz); }

}  // namespace versavis::daemon
