// SPDX-License-Identifier: BSD-3-Clause
#include "configuration/configuration.hpp"

#include <fmt/format.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "engine/toml/table_reader.hpp"

namespace versavis::daemon {

namespace {

/// Longest exposure that a camera may be set to: 10 s. At half, long exposures are refused; at
/// twice, nothing that anybody does is allowed in addition.
constexpr double longest_us = 1e7;

/// What 32 bits of nanoseconds on the wire hold. Less would refuse what works; more does not fit.
constexpr double longest_shift_us = 4e6;

/// Slots for frames that wait for proof, and for the newest ones that readers still want. At half,
/// a start pattern cannot be proved; at twice, each camera takes eight frames more.
constexpr unsigned spare_slots = 8;

/// How long complete frames wait behind one that lost packets. At half, fast cameras run out of
/// buffers then; at twice, they take twice the memory for it.
constexpr double longest_wait_s = 0.12;

/// Slowest edge of an exposure line. At half, the slowest known lines still fit; at twice, a figure
/// in nanoseconds by mistake is taken for microseconds more often.
constexpr double slowest_edge_us = 1000;

/// Delay of a board's own driver or buffer: nanoseconds, with room for a filter at the input. At
/// half, a slow filter is refused; at twice, a figure of the camera's line is taken here.
constexpr double slowest_board_ns = 100'000;

/// Filter delay of an IMU. At half, strong filters at low rates are refused; at twice, milliseconds
/// by mistake are taken for microseconds more often.
constexpr double longest_filter_us = 1e6;

bool valid_name(const std::string& name) {
    const auto allowed = [](char c) {
        return (std::isalnum(static_cast<unsigned char>(c)) != 0) || c == '_' || c == '-';
    };
    return !name.empty() && name.size() < 32 && std::all_of(name.begin(), name.end(), allowed);
}

/// Names become file names and must be unique.
class Names {
 public:
    void check(TableReader& reader, const std::string& name) {
        if (!valid_name(name))
            reader.fail("name", fmt::format("'{}' is not a valid name", name),
                        "use up to 31 letters, digits, '_' and '-'");
        if (name.size() >= evidence_suffix.size() &&
            name.compare(name.size() - evidence_suffix.size(), std::string::npos,
                         evidence_suffix) == 0)
            reader.fail("name", fmt::format("names that end in '{}' are taken", evidence_suffix));
        if (!taken_.insert(name).second)
            reader.fail("name", fmt::format("the name '{}' is taken", name));
    }

 private:
    std::set<std::string> taken_{"clock", "events", "status"};
};

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
    if (board.link != "usb" && board.link.rfind("unix:", 0) != 0)
        reader.fail("link", fmt::format("'{}' is not a valid link", board.link),
                    "use \"usb\" or \"unix:/path/of/socket\"");
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
    if (clock.pps != PpsLabels::off && clock.output == OutputClockKind::monotonic_raw)
        reader.fail("pps", "PPS cannot label CLOCK_MONOTONIC_RAW",
                    "choose output = \"realtime\" or \"tai\", or pps = \"off\"");
}

void read_features(TomlFile& file, const toml::table& table, CameraConfiguration& camera) {
    for (const auto& [key, node] : table) {
        std::ostringstream text;
        if (const auto* string = node.as_string())
            text << string->get();
        else if (node.is_number() || node.is_boolean())
            text << toml::node_view(node);
        else
            file.fail(node, fmt::format("feature '{}' must be a text, a number, true or false",
                                        key.str()));
        camera.features.emplace_back(key.str(), text.str());
    }
}

void read_trigger(TableReader& reader, CameraConfiguration& camera) {
    reader.choose<TriggerSource>(
        "trigger", camera.trigger,
        {{"board", TriggerSource::board}, {"free", TriggerSource::free_run}});
    reader.read("output", camera.output, 0, wire::camera_count - 1);
    reader.read("master", camera.master);
    if (!camera.master.empty() && (reader.has("rate_hz") || reader.has("phase_us")))
        reader.fail(reader.has("rate_hz") ? "rate_hz" : "phase_us",
                    "a slave has its master's rate and phase", "remove the key, or 'master'");
    reader.read("rate_hz", camera.rate_hz, 0.1, 1000);
    const double period_us = 1e6 / camera.rate_hz;
    reader.read("phase_us", camera.phase_us, 0,
                std::min(longest_shift_us, std::nextafter(period_us, 0)));
    reader.read("exposure_us", camera.exposure_us, 0, longest_us);
    reader.read("max_exposure_us", camera.max_exposure_us, 1, longest_us);
    if (camera.max_exposure_us == 0) camera.max_exposure_us = period_us;
    reader.read("latency_us", camera.latency_us, 0, std::min(1e5, std::nextafter(period_us, 0)));
    reader.read("gap_us", camera.gap_us, 0,
                std::min(longest_shift_us, std::nextafter(period_us, 0)));
    camera.pulse_us = std::min(camera.pulse_us, period_us / 4);
    reader.read("pulse_us", camera.pulse_us, 1, std::min(1e4, period_us / 2));
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
    reader.choose<bool>("exposure", camera.exposure_by_pulse, {{"timed", false}, {"pulse", true}});
}

void read_auto_exposure(TomlFile& file, TableReader& reader, CameraConfiguration& camera) {
    AutoExposureConfiguration& control = camera.auto_exposure;
    control.max_us = camera.max_exposure_us;
    const toml::table* table = reader.table("auto_exposure");
    if (table == nullptr) return;
    TableReader keys(file, *table);
    control.enabled = true;
    keys.read("target", control.target, 0.01, 0.99);
    keys.read("percentile", control.percentile, 0, 100);
    keys.read("min_us", control.min_us, 1, longest_us);
    keys.read("max_us", control.max_us, control.min_us, camera.max_exposure_us);
    keys.read("largest_step", control.largest_step, 1.01, 10);
    keys.read("delay_frames", control.delay_frames, 0, 10);
    keys.finish();
}

/// A slave begins with the rate of its master, by which its other keys are checked.
CameraConfiguration inherited(const toml::table& root, const toml::table& table) {
    CameraConfiguration camera;
    const auto master = table["master"].value<std::string>();
    const toml::array* all = root["camera"].as_array();
    if (!master || all == nullptr) return camera;
    for (const toml::node& node : *all) {
        const toml::table* other = node.as_table();
        if (other == nullptr || (*other)["name"].value_or(std::string()) != *master) continue;
        camera.rate_hz = std::clamp((*other)["rate_hz"].value_or(camera.rate_hz), 0.1, 1000.0);
        camera.max_exposure_us = std::max((*other)["max_exposure_us"].value_or(0.0), 0.0);
    }
    return camera;
}

CameraConfiguration read_camera(TomlFile& file, TableReader& reader, CameraConfiguration camera) {
    reader.read("name", camera.name);
    reader.read("device", camera.device);
    read_trigger(reader, camera);
    reader.read("buffers", camera.buffers, 2, 64);
    camera.slots = std::min(camera.buffers + spare_slots +
                                static_cast<unsigned>(std::ceil(camera.rate_hz * longest_wait_s)),
                            1024U);
    reader.read("slots", camera.slots, camera.buffers + spare_slots, 1024);
    reader.read("packet_size", camera.packet_size, 576, 16000);
    reader.choose<ReceiveMode>("receive", camera.receive,
                               {{"socket", ReceiveMode::socket}, {"packet", ReceiveMode::packet}});
    reader.read("latest_arrival_ms", camera.latest_arrival_ms, 1, 60000);
    reader.choose<OnUnproved>("on_unproved", camera.on_unproved,
                              {{"withhold", OnUnproved::withhold}, {"flag", OnUnproved::flag}});
    reader.read("camera_clock", camera.camera_clock);
    if (!camera.camera_clock && camera.latest_arrival_ms > 900)
        reader.fail("latest_arrival_ms",
                    "without 'camera_clock', 'latest_arrival_ms' must be 900 at most",
                    "its slow start sends one pulse a second");
    reader.read("chunks", camera.chunks);
    reader.read("ptp", camera.ptp);
    reader.read("max_temperature_c", camera.max_temperature_c, 0, 200);
    reader.read("link_mbps", camera.link_mbps, 0, 1e6);
    read_auto_exposure(file, reader, camera);
    reader.read("check_exposure", camera.check_exposure);
    if (const toml::table* features = reader.table("features"))
        read_features(file, *features, camera);
    if (camera.device.empty())
        reader.fail("device", "a camera needs a 'device'",
                    "give its IP address, serial number or full name; arv-tool-0.8 lists them");
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
    reader.read("data_ready", imu.data_ready);
    // On the board's grid a reading is set up half a millisecond ahead.
    reader.read("rate_hz", imu.rate_hz, 1, imu.data_ready ? 8000 : 1000);
    reader.read("filter", imu.filter, 0, 7);
    if (reader.has("filter_delay_us"))
        reader.read("filter_delay_us", imu.filter_delay_us.emplace(), 0, longest_filter_us);
    return imu;
}

void read_illumination(TableReader& reader, IlluminationConfiguration& light) {
    reader.read("cameras", light.cameras);
    reader.read("lead_us", light.lead_us, 0, 1000);
    reader.read("max_on_us", light.max_on_us, 10 + light.lead_us, 1e6);
    reader.read("duty_percent", light.duty_percent, 0.0001, 100);
    reader.read("inverted", light.inverted);
}

void read_ports(TableReader& reader, PortConfiguration& ports) {
    reader.read("inputs", ports.inputs);
    reader.read("falling", ports.falling);
    for (const char* key : {"inputs", "falling"})
        for (const std::string& name : *key == 'i' ? ports.inputs : ports.falling)
            if (std::find(pulse_input_names.begin(), pulse_input_names.end(), name) ==
                pulse_input_names.end())
                reader.fail(key, fmt::format("'{}' is not an input", name),
                            fmt::format("use some of: {}", fmt::join(pulse_input_names, ", ")));
    reader.read("imu_output", ports.imu_output);
    reader.read("nmea", ports.nmea);
    reader.read("nmea_baud", ports.nmea_baud, 1200, 921600);
    if (ports.nmea &&
        std::find(ports.inputs.begin(), ports.inputs.end(), "pps") == ports.inputs.end())
        reader.fail("nmea", "'nmea' names the pulses of the PPS input, which is not enabled",
                    "add \"pps\" to 'inputs'");
    reader.read("test", ports.test);
    reader.read("sync_rate_hz", ports.sync_rate_hz, 0, 10);
    reader.read("pulse_us", ports.pulse_us, 1, 1e4);
    if (ports.sync_rate_hz != 0 && ports.sync_rate_hz < 0.1)
        reader.fail("sync_rate_hz", "'sync_rate_hz' must be 0 (no pulses), or 0.1 to 10");
}

void check_pps(TableReader& top, const Configuration& configuration) {
    using clock::PpsLabels;
    const std::vector<std::string>& inputs = configuration.ports.inputs;
    const PpsLabels labels = configuration.clock.pps;
    if (labels != PpsLabels::off && std::find(inputs.begin(), inputs.end(), "pps") == inputs.end())
        top.fail("clock", "'pps' of [clock] needs the PPS input, which is not enabled",
                 "add \"pps\" to 'inputs' of [ports]");
    if (labels == PpsLabels::nmea && !configuration.ports.nmea)
        top.fail("clock", "pps = \"nmea\" of [clock] needs a receiver at the board's UART",
                 "set nmea = true in [ports], or pps = \"host\"");
}

void check_outputs(TableReader& top, const std::vector<CameraConfiguration>& cameras) {
    std::set<unsigned> taken;
    for (const CameraConfiguration& camera : cameras)
        if (camera.trigger == TriggerSource::board && !taken.insert(camera.output).second)
            top.fail("camera",
                     fmt::format("camera '{}' uses output {}, which is taken", camera.name,
                                 camera.output),
                     "give each triggered camera an 'output' of its own, 0 to 3");
}

/// A slave takes rate and phase of its master; masters have an exposure line and no master.
void check_masters(TableReader& top, Configuration& configuration) {
    for (CameraConfiguration& camera : configuration.cameras) {
        if (camera.master.empty()) continue;
        const CameraConfiguration* master = find_triggered_camera(configuration, camera.master);
        if (master == nullptr || master == &camera || !master->master.empty() ||
            master->strobe == Strobe::none) {
            top.fail("camera",
                     fmt::format("camera '{}' cannot have '{}' as its master", camera.name,
                                 camera.master),
                     "name another camera that the board triggers, that has an exposure line and "
                     "no master");
            continue;
        }
        camera.rate_hz = master->rate_hz;
        camera.phase_us = master->phase_us;
        camera.max_exposure_us = master->max_exposure_us;
    }
}

void check_imus(TableReader& top, const std::vector<ImuConfiguration>& imus, bool nmea) {
    std::set<unsigned> taken;
    for (const ImuConfiguration& imu : imus)
        if (imu.model != nullptr && !taken.insert(imu.port()).second)
            top.fail(
                "imu",
                fmt::format("the board has one {} port for IMUs", imu.port() == 0 ? "SPI" : "UART"),
                "a vn100 is on the UART, all others on the SPI; remove one of the [[imu]] tables");
    if (nmea && taken.count(1) != 0)
        top.fail("ports", "'nmea' needs the UART, which the vn100 has", "remove one of them");
}

void check_names(TableReader& top, const Configuration& configuration) {
    for (const std::string& name : configuration.illumination.cameras)
        if (find_triggered_camera(configuration, name) == nullptr)
            top.fail("illumination",
                     fmt::format("'{}' is not a camera that the board triggers", name));
    if (!test_source(configuration))
        top.fail("ports",
                 fmt::format("'test' names '{}', which is neither a triggered camera nor an IMU",
                             configuration.ports.test));
}

}  // namespace

Expected<Configuration> load_configuration(const std::string& path) {
    const auto root = parse_toml(path);
    if (!root) return Unexpected(root.error());
    TomlFile file{path, "docs/user/configuration.md"};
    Configuration configuration;
    Names names;
    TableReader top(file, *root);
    top.read("instance", configuration.instance);
    if (!valid_name(configuration.instance))
        top.fail("instance", "'instance' must be a name of letters and digits");
    top.read("preset_directory", configuration.preset_directory);
    top.read("state_directory", configuration.state_directory);
    top.choose<LogLevel>("log_level", configuration.log_level,
                         {{"error", LogLevel::error},
                          {"warning", LogLevel::warning},
                          {"info", LogLevel::info},
                          {"debug", LogLevel::debug}});
    if (const toml::table* table = top.table("board")) {
        TableReader reader(file, *table);
        read_board(file, reader, configuration.board);
        reader.finish();
    }
    if (const toml::table* table = top.table("clock")) {
        TableReader reader(file, *table);
        read_clock(reader, configuration.clock);
        reader.finish();
    }
    for (const toml::table* table : top.tables("camera")) {
        TableReader reader(file, *table);
        configuration.cameras.push_back(read_camera(file, reader, inherited(*root, *table)));
        names.check(reader, configuration.cameras.back().name);
        reader.finish();
    }
    for (const toml::table* table : top.tables("imu")) {
        TableReader reader(file, *table);
        configuration.imus.push_back(read_imu(reader));
        names.check(reader, configuration.imus.back().name);
        reader.finish();
    }
    if (const toml::table* table = top.table("illumination")) {
        TableReader reader(file, *table);
        read_illumination(reader, configuration.illumination);
        reader.finish();
    }
    if (const toml::table* table = top.table("ports")) {
        TableReader reader(file, *table);
        read_ports(reader, configuration.ports);
        reader.finish();
    }
    for (CameraConfiguration& camera : configuration.cameras) {
        camera.board_input_ns = configuration.board.input_delay_ns[camera.output];
        camera.board_output_ns = configuration.board.output_delay_ns[camera.output];
    }
    check_imus(top, configuration.imus, configuration.ports.nmea);
    check_pps(top, configuration);
    check_outputs(top, configuration.cameras);
    check_masters(top, configuration);
    check_names(top, configuration);
    top.finish();
    if (!file.result) return Unexpected(file.result.error());
    return configuration;
}

const CameraConfiguration* find_triggered_camera(const Configuration& configuration,
                                                 const std::string& name) {
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.name == name && camera.trigger == TriggerSource::board) return &camera;
    return nullptr;
}

std::optional<std::uint8_t> test_source(const Configuration& configuration) {
    if (configuration.ports.test.empty()) return std::uint8_t{wire::test_none};
    if (const CameraConfiguration* camera =
            find_triggered_camera(configuration, configuration.ports.test))
        return static_cast<std::uint8_t>(wire::test_camera0 + camera->output);
    for (const ImuConfiguration& imu : configuration.imus)
        if (imu.name == configuration.ports.test)
            return static_cast<std::uint8_t>(wire::test_imu0 + imu.port());
    return std::nullopt;
}

imu::FilterDelay ImuConfiguration::filter_delay() const {
    if (filter_delay_us) return {from_us(*filter_delay_us), {}, imu::DelaySource::configuration};
    return imu::filter_delay(*model, filter, rate_hz, data_ready);
}

Duration from_us(double us) { return {std::llround(us * 1e3)}; }

Duration period_of(const CameraConfiguration& camera) { return from_us(1e6 / camera.rate_hz); }

}  // namespace versavis::daemon
