// SPDX-License-Identifier: BSD-3-Clause
#include "configuration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "configuration_check.hpp"
#include "engine/toml/table_reader.hpp"
#include "wire/limits.hpp"

namespace versavis::daemon {

namespace {

namespace limits = wire::limits;
constexpr double ns_per_us = 1e3;
constexpr double longest_us = limits::longest_exposure_ns / ns_per_us;

/// What 32 bits of nanoseconds on the wire hold. Less would refuse what works; more does not fit.
constexpr double longest_shift_us = 4e6;

/// Slots for frames that wait for proof, and for the newest ones that readers still want. At half,
/// a start pattern cannot be proved; at twice, each camera takes eight frames more.
constexpr unsigned spare_slots = 8;

/// How long complete frames wait behind one that lost packets. At half, fast cameras run out of
/// buffers then; at twice, they take twice the memory for it.
constexpr double longest_wait_s = 0.12;

/// Longest history of a ring: an hour. Half: recordings after the event must begin sooner. Twice:
/// no machine has the memory.
constexpr double longest_history_s = 3600;

/// Trigger pulses, where the period leaves room for them: half of what it may be.
constexpr double usual_part_of_period = 0.25;

/// Slowest edge of an exposure line. At half, the slowest known lines still fit; at twice, a figure
/// in nanoseconds by mistake is taken for microseconds more often.
constexpr double slowest_edge_us = 1000;

/// Delay of a board's own driver or buffer: nanoseconds, with room for a filter at the input. At
/// half, a slow filter is refused; at twice, a figure of the camera's line is taken here.
constexpr double slowest_board_ns = 100'000;

/// Longest and shortest filter of an exposure line: what the wire's 8 bits of 0.1 us hold. Half
/// would refuse what works; twice does not fit.
constexpr double longest_glitch_us = 25.5;
constexpr double shortest_glitch_us = 0.1;

/// Filter delay of an IMU. At half, strong filters at low rates are refused; at twice, milliseconds
/// by mistake are taken for microseconds more often.
constexpr double longest_filter_us = 1e6;

void read_board(TomlFile& file, TableReader& reader, BoardConfiguration& board) {
    reader.read("link", board.link);
    reader.read("serial", board.serial);
    reader.read("usb_vendor", board.usb_vendor, 0, 0xFFFF);
    reader.read("usb_product", board.usb_product, 0, 0xFFFF);
    reader.read("keep_configuration", board.keep_configuration);
    if (const toml::table* table = reader.table("board_delay_ns")) {
        TableReader delays(file, *table);
        delays.read("inputs", board.input_delay_ns, wire::camera_count, 0, slowest_board_ns);
        delays.read("outputs", board.output_delay_ns, wire::camera_count, 0, slowest_board_ns);
        delays.finish();
    }
}

void read_clock(TableReader& reader, ClockConfiguration& clock) {
    using clock::OutputClockKind;
    reader.choose<OutputClockKind>("output", clock.output,
                                   {{"realtime", OutputClockKind::realtime},
                                    {"tai", OutputClockKind::tai},
                                    {"monotonic_raw", OutputClockKind::monotonic_raw}});
    reader.read("force_tai", clock.force_tai);
    reader.read("exchange_rate_hz", clock.exchange_rate_hz, 1, 100);
    reader.read("align", clock.align);
    reader.read("max_slew_ppm", clock.max_slew_ppm, 0.1, 500);
    using clock::PpsLabels;
    reader.choose<PpsLabels>(
        "pps", clock.pps,
        {{"off", PpsLabels::off}, {"host", PpsLabels::host}, {"nmea", PpsLabels::nmea}});
}

/// The camera's own exposure, where the file sets it.
void check_exposure_feature(TableReader& reader, std::string_view key, const toml::node& node,
                            const CameraConfiguration& camera) {
    const auto us = node.is_number() ? node.value<double>() : std::nullopt;
    if ((key != "ExposureTime" && key != "ExposureTimeAbs") || !us) return;
    if (const auto hidden = hidden_exposure(camera, key, *us))
        reader.fail(key, hidden->what, hidden->cure);
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
        return reader.fail(key, fmt::format("'{}' is a key of the camera, and no feature", key),
                           "move it above [camera.features]");
    for (const auto& [feature, own] : own_features)
        if (key == feature && camera.trigger == TriggerSource::board)
            reader.fail(key, fmt::format("'{}' is set by the service, as '{}' says", key, own),
                        fmt::format("set '{}' of the camera instead", own));
}

void read_features(TableReader& reader, const TableReader& camera_keys, const toml::table& table,
                   CameraConfiguration& camera) {
    for (const auto& [key, node] : table) {
        check_feature_name(reader, camera_keys, key.str(), camera);
        check_exposure_feature(reader, key.str(), node, camera);
        std::ostringstream text;
        if (const auto* string = node.as_string())
            text << string->get();
        else if (node.is_boolean() || std::isfinite(node.value<double>().value_or(NAN)))
            text << toml::node_view(node);
        else
            reader.fail(key.str(),
                        fmt::format("feature '{}' must be a text, a number, true or false",
                                    clipped(key.str())));
        camera.features.emplace_back(key.str(), text.str());
    }
}

void read_trigger(TableReader& reader, CameraConfiguration& camera) {
    reader.choose<TriggerSource>(
        "trigger", camera.trigger,
        {{"board", TriggerSource::board}, {"free", TriggerSource::free_run}});
    reader.read("output", camera.output, 0, wire::camera_count - 1);
    reader.read("master", camera.master);
    reader.read("rate_hz", camera.rate_hz, limits::slowest_camera_uhz / 1e6,
                limits::fastest_camera_uhz / 1e6);
    reader.read("phase_us", camera.phase_us, 0, longest_shift_us);
    reader.read("exposure_us", camera.exposure_us, 0, longest_us);
    reader.read("max_exposure_us", camera.max_exposure_us,
                limits::shortest_max_exposure_ns / ns_per_us, longest_us);
    reader.read("latency_us", camera.latency_us, 0, limits::longest_latency_ns / ns_per_us);
    reader.read("gap_us", camera.gap_us, 0, longest_shift_us);
    reader.read("pulse_us", camera.pulse_us, limits::shortest_pulse_ns / ns_per_us,
                limits::longest_pulse_ns / ns_per_us);
    reader.read("trigger_inverted", camera.trigger_inverted);
    reader.choose<Strobe>("strobe", camera.strobe,
                          {{"active_high", Strobe::active_high},
                           {"active_low", Strobe::active_low},
                           {"none", Strobe::none}});
    reader.read("preset", camera.preset);
    reader.read("trigger_line", camera.trigger_line);
    reader.read("strobe_line", camera.strobe_line);
    reader.read("strobe_rising_us", camera.strobe_rising_us, 2, 0, slowest_edge_us);
    reader.read("strobe_falling_us", camera.strobe_falling_us, 2, 0, slowest_edge_us);
    if (camera.strobe_rising_us.empty() != camera.strobe_falling_us.empty())
        reader.fail(reader.has("strobe_rising_us") ? "strobe_rising_us" : "strobe_falling_us",
                    "the delays of both edges of the exposure line are needed",
                    "set 'strobe_rising_us' and 'strobe_falling_us', each [value, sigma]");
    reader.read("glitch_us", camera.glitch_us, shortest_glitch_us, longest_glitch_us);
    reader.choose<bool>("exposure", camera.exposure_by_pulse, {{"timed", false}, {"pulse", true}});
}

void read_auto_exposure(TomlFile& file, TableReader& reader, CameraConfiguration& camera) {
    AutoExposureConfiguration& control = camera.auto_exposure;
    const toml::table* table = reader.table("auto_exposure");
    if (table == nullptr) return;
    TableReader keys(file, *table, "[camera.auto_exposure]");
    control.enabled = true;
    keys.read("target", control.target, 0.01, 0.99);
    keys.read("percentile", control.percentile, 0, 100);
    keys.read("min_us", control.min_us, 1, longest_us);
    keys.read("max_us", control.max_us, 1, longest_us);
    keys.read("largest_step", control.largest_step, 1.01, 10);
    keys.read("delay_frames", control.delay_frames, 0, 10);
    keys.finish();
    control.entry = keys.entry();
}

CameraConfiguration read_camera(TomlFile& file, TableReader& reader) {
    CameraConfiguration camera;
    reader.read("name", camera.name);
    reader.read("device", camera.device);
    read_trigger(reader, camera);
    reader.read("buffers", camera.buffers, 2, 64);
    reader.read("slots", camera.slots, camera.buffers + spare_slots, 1024);
    reader.read("history_s", camera.history_s, 0, longest_history_s);
    reader.read("packet_size", camera.packet_size, 576, 16000);
    reader.choose<ReceiveMode>("receive", camera.receive,
                               {{"auto", ReceiveMode::automatic},
                                {"socket", ReceiveMode::socket},
                                {"packet", ReceiveMode::packet}});
    reader.read("latest_arrival_ms", camera.latest_arrival_ms, 1, 60000);
    reader.choose<OnUnproved>("on_unproved", camera.on_unproved,
                              {{"withhold", OnUnproved::withhold}, {"flag", OnUnproved::flag}});
    reader.choose<pairing::Instant>("stamp_instant", camera.stamp_instant,
                                    {{"auto", pairing::Instant::unknown},
                                     {"start", pairing::Instant::start},
                                     {"middle", pairing::Instant::middle},
                                     {"end", pairing::Instant::end}});
    reader.read("camera_clock", camera.camera_clock);
    if (reader.has("chunks")) reader.read("chunks", camera.chunks.emplace());
    reader.read("keep_settings", camera.keep_settings);
    reader.read("ptp", camera.ptp);
    reader.read("max_temperature_c", camera.max_temperature_c, 0, 200);
    reader.read("link_mbps", camera.link_mbps, 0, 1e6);
    read_auto_exposure(file, reader, camera);
    reader.read("check_exposure", camera.check_exposure);
    if (const toml::table* table = reader.table("features")) {
        TableReader features(file, *table, "[camera.features]");
        read_features(features, reader, *table, camera);
    }
    return camera;
}

ImuConfiguration read_imu(TableReader& reader) {
    ImuConfiguration imu;
    std::vector<std::pair<std::string, const imu::ImuModel*>> models;
    for (const std::string& name : imu::model_names())
        models.emplace_back(name, imu::find_model(name));
    imu.model = models.front().second;
    reader.read("name", imu.name);
    reader.choose<const imu::ImuModel*>("model", imu.model, models);
    reader.choose<ImuBus>("bus", imu.bus, {{"spi", ImuBus::spi}, {"i2c", ImuBus::i2c}});
    reader.read("i2c_address", imu.i2c_address, 0, 0xFF);
    reader.read("data_ready", imu.data_ready);
    reader.read("accel_ready", imu.accel_ready);
    reader.read("rate_hz", imu.rate_hz, 1, 8000);
    reader.read("filter", imu.filter, 0, 7);
    reader.read("history_s", imu.history_s, 0, longest_history_s);
    if (reader.has("filter_delay_us"))
        reader.read("filter_delay_us", imu.filter_delay_us.emplace(), 0, longest_filter_us);
    return imu;
}

void read_illumination(TableReader& reader, IlluminationConfiguration& light) {
    reader.read("cameras", light.cameras);
    reader.read("lead_us", light.lead_us, 0, limits::longest_lead_ns / ns_per_us);
    reader.read("max_on_us", light.max_on_us, limits::shortest_light_ns / ns_per_us + light.lead_us,
                limits::longest_light_ns / ns_per_us);
    reader.read("duty_percent", light.duty_percent, 0.0001, 100);
    reader.read("inverted", light.inverted);
}

void read_ports(TableReader& reader, PortConfiguration& ports) {
    reader.read("inputs", ports.inputs);
    reader.read("falling", ports.falling);
    reader.read("imu_output", ports.imu_output);
    reader.read("nmea", ports.nmea);
    reader.read("nmea_baud", ports.nmea_baud, limits::slowest_nmea_baud, limits::fastest_nmea_baud);
    reader.read("test", ports.test);
    reader.read("test_rate_hz", ports.test_rate_hz, 0, fastest_test_hz);
    reader.choose<std::uint8_t>("test_output", ports.test_output, test_outputs);
    reader.read("sync_rate_hz", ports.sync_rate_hz, 0, fastest_sync_hz);
    reader.read("pulse_us", ports.pulse_us, limits::shortest_pulse_ns / ns_per_us,
                limits::longest_pulse_ns / ns_per_us);
}

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
template <class Part, class Read>
void read_part(TomlFile& file, TableReader& top, const char* name, Part& part, Read read) {
    const toml::table* table = top.table(name);
    if (table == nullptr) return;
    TableReader reader(file, *table, fmt::format("[{}]", name));
    read(reader, part);
    reader.finish();
    part.entry = reader.entry();
}

/// All tables of an array.
template <class Part, class Read>
void read_parts(TomlFile& file, TableReader& top, const char* name, std::vector<Part>& parts,
                Read read) {
    for (const toml::table* table : top.tables(name)) {
        const std::string own_name = (*table)["name"].value_or(std::string());
        TableReader reader(file, *table,
                           own_name.empty()
                               ? fmt::format("[[{}]]", name)
                               : fmt::format("[[{}]] \"{}\"", name, clipped(own_name)));
        parts.push_back(read(reader));
        reader.finish();
        parts.back().entry = reader.entry();
    }
}

void read_top(TableReader& top, Configuration& configuration) {
    top.read("instance", configuration.instance);
    top.read("preset_directory", configuration.preset_directory);
    top.read("state_directory", configuration.state_directory);
    top.choose<LogLevel>("log_level", configuration.log_level,
                         {{"error", LogLevel::error},
                          {"warning", LogLevel::warning},
                          {"info", LogLevel::info},
                          {"debug", LogLevel::debug}});
}

}  // namespace

Expected<Configuration, TomlProblems> load_configuration(const std::string& path) {
    const auto root = parse_toml(path);
    if (!root) return Unexpected(TomlProblems{root.error()});
    TomlFile file{path, "docs/user/configuration.md"};
    Configuration configuration;
    TableReader top(file, *root);
    read_top(top, configuration);
    read_part(
        file, top, "board", configuration.board,
        [&](TableReader& reader, BoardConfiguration& board) { read_board(file, reader, board); });
    read_part(file, top, "clock", configuration.clock, read_clock);
    read_parts(file, top, "camera", configuration.cameras,
               [&](TableReader& reader) { return read_camera(file, reader); });
    read_parts(file, top, "imu", configuration.imus, read_imu);
    read_part(file, top, "illumination", configuration.illumination, read_illumination);
    read_part(file, top, "ports", configuration.ports, read_ports);
    read_part(file, top, "memory", configuration.memory,
              [](TableReader& reader, MemoryConfiguration& memory) {
                  reader.read("lock", memory.lock);
                  reader.read("sealed", memory.sealed);
              });
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
