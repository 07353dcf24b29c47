// SPDX-License-Identifier: BSD-3-Clause
#include "configuration_check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/un.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <tuple>

#include "camera_preset.hpp"
#include "device_name.hpp"
#include "engine/pairing/pairing.hpp"
#include "findings.hpp"
#include "receive_mode.hpp"
#include "time_output_check.hpp"

namespace versavis::daemon {

namespace {

/// A slow start sends one pulse a second: a frame must come before the next.
constexpr double longest_arrival_without_clock_ms = 900;

constexpr double fastest_on_grid_hz = wire::limits::fastest_imu_without_data_ready_millihertz / 1e3;
constexpr double slowest_test_hz = wire::limits::slowest_test_millihertz / 1e3;
constexpr double slowest_sync_hz = wire::limits::slowest_sync_uhz / 1e6;

/// Names become names of files.
bool valid_name(const std::string& name) {
    const auto allowed = [](unsigned char c) {
        return std::isalnum(c) != 0 || c == '_' || c == '-';
    };
    return !name.empty() && name.size() < 32 && std::all_of(name.begin(), name.end(), allowed);
}

void check_instance(const Configuration& configuration, Findings& findings) {
    if (!valid_name(configuration.instance))
        findings.add(configuration.entry, "instance",
                     fmt::format("'{}' is not a valid name", clipped(configuration.instance)),
                     "use at most 31 letters, digits, '_' and '-'");
}

const std::string unix_link = "unix:";

void check_link(const Configuration& configuration, Findings& findings) {
    const BoardConfiguration& board = configuration.board;
    const std::string& prefix = unix_link;
    const bool is_unix = board.link.rfind(prefix, 0) == 0;
    const std::size_t longest = sizeof(sockaddr_un::sun_path) - 1;
    if (board.link != "usb" && (!is_unix || board.link == prefix))
        findings.add(board.entry, "link",
                     fmt::format("'{}' is not a valid link", clipped(board.link)),
                     "use \"usb\" or \"unix:/path/of/socket\"");
    else if (is_unix && board.link.size() - prefix.size() > longest)
        findings.add(board.entry, "link",
                     fmt::format("a socket path can have at most {} characters", longest),
                     "use a shorter path");
}

/// What a shell would expand.
bool has_shell_marks(const std::string& path) {
    return path.front() == '~' || path.find('$') != std::string::npos;
}

void check_paths(const Configuration& configuration, Findings& findings) {
    const auto check = [&](const TomlEntry& entry, const char* key, const std::string& path) {
        if (!path.empty() && has_shell_marks(path))
            findings.add(entry, key, "'~' and '$' have no meaning in a path here",
                         "write the whole path");
    };
    check(configuration.entry, "preset_directory", configuration.preset_directory);
    check(configuration.entry, "state_directory", configuration.state_directory);
    const std::string& link = configuration.board.link;
    if (link.rfind(unix_link, 0) == 0)
        check(configuration.board.entry, "link", link.substr(unix_link.size()));
}

void check_pps(const Configuration& configuration, Findings& findings) {
    using clock::PpsLabels;
    const ClockConfiguration& clock = configuration.clock;
    if (clock.pps == PpsLabels::off) return;
    if (clock.output == clock::OutputClockKind::monotonic_raw)
        findings.add(clock.entry, "pps", "PPS cannot label CLOCK_MONOTONIC_RAW",
                     "set output = \"realtime\" or \"tai\", or pps = \"off\"");
    if (!contains(configuration.ports.inputs, "pps"))
        findings.add(clock.entry, "pps", "'pps' needs the PPS input, which is not enabled",
                     "add \"pps\" to 'inputs' of [ports]");
    if (clock.pps == PpsLabels::nmea && !configuration.ports.nmea)
        findings.add(clock.entry, "pps", "pps = \"nmea\" needs a GNSS receiver at the board's UART",
                     "set nmea = true in [ports], or pps = \"host\"");
}

struct NamedEntry {
    const TomlEntry& entry;
    const std::string& name;
};

void check_names(const Configuration& configuration, Findings& findings) {
    std::vector<NamedEntry> all;
    for (const auto& camera : configuration.cameras) all.push_back({camera.entry, camera.name});
    for (const auto& imu : configuration.imus) all.push_back({imu.entry, imu.name});
    for (const auto& output : configuration.time_outputs)
        all.push_back({output.entry, output.name});
    const std::vector<std::string> taken{"clock", "events", "status", nmea_stream};
    for (const auto& [entry, name] : all) {
        const std::size_t stem = name.size() - std::min(name.size(), evidence_suffix.size());
        if (name.empty())
            findings.add(entry, "name", "'name' is missing", "set one, such as \"cam0\"");
        else if (!valid_name(name))
            findings.add(entry, "name", fmt::format("'{}' is not a valid name", clipped(name)),
                         "use at most 31 letters, digits, '_' and '-'");
        else if (contains(taken, name) || name.substr(stem) == evidence_suffix)
            findings.add(entry, "name",
                         fmt::format("the name '{}' is reserved for a stream of the service", name),
                         "choose another name");
    }
    find_repeated(
        all, [](const NamedEntry& a, const NamedEntry& b) { return a.name == b.name; },
        [&](const NamedEntry& first, const NamedEntry& second) {
            findings.add(second.entry, "name",
                         fmt::format("the name '{}' is already used by {}", second.name,
                                     at_line(first.entry, second.entry)),
                         "choose another name");
        });
}

void check_devices(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        if (camera.device.empty())
            findings.add(
                camera.entry, "device", "'device' is missing",
                "set the camera's IP address, serial number or name; versavis discover lists them");
        else if (const auto fault = device_fault(camera.device))
            findings.add(camera.entry, "device",
                         fmt::format("'{}' {}", clipped(camera.device), fault->what), fault->cure);
    }
    find_repeated(
        configuration.cameras,
        [](const CameraConfiguration& a, const CameraConfiguration& b) {
            return !a.device.empty() && same_device(a.device, b.device);
        },
        [&](const CameraConfiguration& first, const CameraConfiguration& second) {
            findings.add(second.entry, "device",
                         fmt::format("the device '{}' is already used by {}",
                                     clipped(second.device), at_line(first.entry, second.entry)),
                         "set another device, or remove one of the two tables");
        });
}

/// The lateness of a packet socket varies.
void check_receive(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras)
        if (camera.receive == ReceiveMode::packet && !packet_socket_suits(camera))
            findings.add(
                camera.entry, "receive",
                fmt::format("receive = \"packet\" may delay frames by {} ms, too much for a "
                            "period of {:g} ms",
                            packet_socket_lateness.ns / 1'000'000,
                            static_cast<double>(period_of(camera).ns) * 1e-6),
                "set receive = \"auto\" or \"socket\"");
}

void check_outputs(const Configuration& configuration, Findings& findings) {
    const auto triggered = [](const CameraConfiguration& camera) {
        return camera.trigger == TriggerSource::board;
    };
    std::vector<unsigned> free;
    for (unsigned output = 0; output < wire::camera_count; ++output)
        if (std::none_of(configuration.cameras.begin(), configuration.cameras.end(),
                         [&](const auto& c) { return triggered(c) && c.output == output; }))
            free.push_back(output);
    find_repeated(
        configuration.cameras,
        [&](const CameraConfiguration& a, const CameraConfiguration& b) {
            return triggered(a) && triggered(b) && a.output == b.output;
        },
        [&](const CameraConfiguration& first, const CameraConfiguration& second) {
            findings.add(second.entry, "output",
                         fmt::format("output {} is already used by {}", second.output,
                                     at_line(first.entry, second.entry)),
                         free.empty() ? "the board triggers at most four cameras: remove one"
                                      : fmt::format("free outputs: {}", fmt::join(free, ", ")));
        });
}

void check_history(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        if (!camera.entry.has("history_s")) continue;
        if (camera.entry.has("slots"))
            findings.add(camera.entry, "history_s",
                         "'slots' and 'history_s' both set the size of the ring",
                         "remove one of the two");
        if (!camera.history)
            findings.add(camera.entry, "history_s",
                         "with history = \"none\" no frames are kept for so long",
                         "remove one of the two");
    }
}

bool can_be_master(const CameraConfiguration& camera) {
    return camera.trigger == TriggerSource::board && camera.master.empty() &&
           camera.strobe != Strobe::none;
}

/// Why `slave` cannot have its master; empty: it can.
std::string wrong_with_master(const Configuration& configuration,
                              const CameraConfiguration& slave) {
    const auto& cameras = configuration.cameras;
    const auto master = std::find_if(cameras.begin(), cameras.end(),
                                     [&](const auto& c) { return c.name == slave.master; });
    if (master == cameras.end()) return "there is no camera with that name";
    if (master->name == slave.name) return "it is the slave itself";
    if (master->trigger != TriggerSource::board) return "the board does not trigger it";
    if (!master->master.empty()) return "it is a slave itself";
    return master->strobe == Strobe::none ? "it has no exposure line" : "";
}

void check_master(const Configuration& configuration, const CameraConfiguration& slave,
                  Findings& findings) {
    if (slave.trigger != TriggerSource::board)
        return findings.add(slave.entry, "master",
                            fmt::format("a camera with trigger = \"{}\" cannot have a 'master'",
                                        slave.trigger == TriggerSource::ptp ? "ptp" : "free"),
                            "remove one of the two");
    for (const char* key : {"rate_hz", "phase_us", "max_exposure_us"})
        if (slave.entry.has(key))
            findings.add(slave.entry, key, fmt::format("a slave takes '{}' from its master", key),
                         "remove the key, or 'master'");
    const std::string wrong = wrong_with_master(configuration, slave);
    if (wrong.empty()) return;
    std::vector<std::string> possible;
    for (const CameraConfiguration& camera : configuration.cameras)
        if (can_be_master(camera) && camera.name != slave.name) possible.push_back(camera.name);
    findings.add(slave.entry, "master",
                 fmt::format("'{}' cannot be the master: {}", clipped(slave.master), wrong),
                 possible.empty() ? "no other camera can be one: remove 'master'"
                                  : fmt::format("possible masters: {}", fmt::join(possible, ", ")));
}

void check_masters(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras)
        if (!camera.master.empty()) check_master(configuration, camera, findings);
}

void check_camera_times(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        const double period = 1e6 / camera.rate_hz;
        const double before_next = period - 1e-3;
        const std::string slower = camera.master.empty() ? "lower it, or 'rate_hz'"
                                                         : "lower it, or 'rate_hz' of its master";
        const auto limit = [&](const char* key, double value, double maximum, const char* reason,
                               const std::string& cure) {
            findings.limit(camera.entry, key, value, maximum, reason, cure);
        };
        limit("latest_arrival_ms", camera.latest_arrival_ms, longest_arrival_ms(camera),
              camera.camera_clock
                  ? "exposures are kept no longer at this rate"
                  : "without 'camera_clock', cameras start at one trigger per second",
              camera.camera_clock ? slower : "lower it, or set camera_clock = true");
        if (camera.trigger == TriggerSource::free_run) continue;
        limit("phase_us", camera.phase_us, before_next, "less than the period", slower);
        limit("latency_us", camera.latency_us, before_next, "less than the period", slower);
        limit("gap_us", camera.gap_us, before_next, "less than the period", slower);
        limit("pulse_us", camera.pulse_us, period / 2, "half the period", slower);
        limit("exposure_us", camera.exposure_us, period - camera.latency_us - camera.gap_us,
              "the period less 'latency_us' and 'gap_us'", slower);
        limit("exposure_us", camera.exposure_us, camera.max_exposure_us, "'max_exposure_us'",
              "lower it, or raise 'max_exposure_us'");
    }
}

/// The board sees the edge at which the exposure begins.
void check_strobe_input(const Configuration& configuration, const CameraConfiguration& camera,
                        Findings& findings) {
    const std::string& input = camera.strobe_input;
    if (input.empty()) return;
    const PortConfiguration& ports = configuration.ports;
    const bool falls = camera.strobe == Strobe::active_low;
    if (input != "aux0" && input != "aux1")
        findings.add(camera.entry, "strobe_input",
                     fmt::format("'{}' is no auxiliary input", clipped(input)),
                     "use \"aux0\" or \"aux1\"");
    else if (!contains(ports.inputs, input))
        findings.add(camera.entry, "strobe_input",
                     fmt::format("the input '{}' is not enabled", input),
                     "add it to 'inputs' of [ports]");
    else if (contains(ports.falling, input) != falls)
        findings.add(camera.entry, "strobe_input",
                     fmt::format("the exposure begins with the other edge of '{}'", input),
                     falls ? "add it to 'falling' of [ports]"
                           : "remove it from 'falling' of [ports], or set strobe = \"active_low\"");
    if (camera.strobe == Strobe::none)
        findings.add(camera.entry, "strobe_input", "'strobe' says that there is no exposure line",
                     "remove one of the two");
    for (const CameraConfiguration& other : configuration.cameras)
        if (&other != &camera && other.strobe_input == input)
            findings.add(camera.entry, "strobe_input",
                         fmt::format("'{}' is already used by {}", input, other.name),
                         "each line needs an input of its own");
}

/// Their frames are proved by the camera's clock and by exposures of a known length.
void check_ptp(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        if (camera.trigger != TriggerSource::ptp) {
            if (!camera.strobe_input.empty())
                findings.add(camera.entry, "strobe_input",
                             "'strobe_input' is for cameras with trigger = \"ptp\"",
                             "remove it: the exposure line belongs to the input of 'output'");
            continue;
        }
        if (!camera.camera_clock)
            findings.add(camera.entry, "camera_clock",
                         "with trigger = \"ptp\" frames are stamped by the camera's clock",
                         "remove 'camera_clock', or trigger the camera by the board");
        check_strobe_input(configuration, camera, findings);
        if (camera.exposure_by_pulse)
            findings.add(camera.entry, "exposure",
                         "with trigger = \"ptp\" there is no trigger pulse that sets the exposure",
                         "set exposure = \"timed\"");
    }
}

void check_line_delays(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        const bool rising = camera.entry.has("strobe_rising_us");
        if (rising != camera.entry.has("strobe_falling_us"))
            findings.add(camera.entry, rising ? "strobe_rising_us" : "strobe_falling_us",
                         "the delay of the other edge of the exposure line is missing",
                         "set 'strobe_rising_us' and 'strobe_falling_us', each [value, sigma]");
    }
}

/// Refuses an exposure that the board would take for a disturbance of its line.
void check_seen(const CameraConfiguration& camera, const TomlEntry& entry, const std::string& key,
                double us, Findings& findings) {
    const bool watched = camera.trigger == TriggerSource::board && camera.strobe != Strobe::none;
    if (!entry.has(key) || !watched || us >= camera.glitch_us) return;
    findings.add(entry, key,
                 fmt::format("'{}' is {:.10g} us, but must be at least {:.10g} us ('glitch_us'): "
                             "the board ignores shorter pulses on the exposure line",
                             key, us, camera.glitch_us),
                 "lower 'glitch_us', or expose longer", TomlRange{camera.glitch_us, std::nullopt});
}

void check_glitch(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        const auto seen = [&](const TomlEntry& entry, const char* key, double us) {
            check_seen(camera, entry, key, us, findings);
        };
        seen(camera.entry, "exposure_us", camera.exposure_us);
        seen(camera.entry, "max_exposure_us", camera.max_exposure_us);
        if (camera.exposure_by_pulse && camera.master.empty())
            seen(camera.entry, "pulse_us", camera.pulse_us);
        if (!camera.auto_exposure.enabled) continue;
        seen(camera.auto_exposure.entry, "min_us", camera.auto_exposure.min_us);
        seen(camera.auto_exposure.entry, "max_us", camera.auto_exposure.max_us);
    }
}

/// The camera's own exposure, in microseconds; none: the feature is another one.
std::optional<double> exposure_of(const std::string& feature, const std::string& value) {
    if (feature != "ExposureTime" && feature != "ExposureTimeAbs") return std::nullopt;
    char* end = nullptr;
    const double us = std::strtod(value.c_str(), &end);
    return end == value.c_str() || *end != '\0' ? std::nullopt : std::optional(us);
}

/// Refuses one that the camera cannot end before its next trigger, or that the board gives up.
void check_exposure_feature(const CameraConfiguration& camera, const std::string& feature,
                            double us, Findings& findings) {
    const auto limit = [&](double most, const char* reason, const char* cure) {
        if (us > most)
            findings.add(camera.features_entry, feature,
                         fmt::format("'{}' is {:.10g} us, but must be at most {:.10g} us ({})",
                                     feature, us, most, reason),
                         cure, TomlRange{std::nullopt, most});
    };
    const double period = 1e6 / camera.rate_hz;
    const char* slower = "lower it, or 'rate_hz'";
    if (camera.trigger == TriggerSource::free_run) return limit(period, "the period", slower);
    limit(period - camera.latency_us - camera.gap_us, "the period less 'latency_us' and 'gap_us'",
          slower);
    limit(camera.max_exposure_us, "'max_exposure_us'", "lower it, or raise 'max_exposure_us'");
}

void check_exposure_features(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras)
        for (const auto& [feature, value] : camera.features)
            if (const auto us = exposure_of(feature, value)) {
                check_seen(camera, camera.features_entry, feature, *us, findings);
                if (!camera.exposure_by_pulse)
                    check_exposure_feature(camera, feature, *us, findings);
            }
}

void check_auto_exposure(const Configuration& configuration, Findings& findings) {
    for (const CameraConfiguration& camera : configuration.cameras) {
        const AutoExposureConfiguration& control = camera.auto_exposure;
        if (!control.enabled) continue;
        findings.limit(control.entry, "max_us", control.max_us, camera.max_exposure_us,
                       "'max_exposure_us' of the camera", "lower it, or raise 'max_exposure_us'");
        findings.limit(control.entry, "min_us", control.min_us, control.max_us, "'max_us'",
                       "lower it, or raise 'max_us'");
        if (camera.exposure_by_pulse)
            findings.add(
                camera.entry, "auto_exposure",
                "with exposure = \"pulse\" the trigger sets the exposure, so auto exposure cannot",
                "set exposure = \"timed\", or remove [camera.auto_exposure]");
    }
}

/// What a preset can do is known without the camera, if it is named.
void check_preset(const CameraConfiguration& camera, const std::vector<CameraPreset>& presets,
                  Findings& findings) {
    if (camera.preset == "auto") return;
    std::vector<std::string> names{"auto"};
    for (const CameraPreset& preset : presets) names.push_back(preset.name);
    const auto preset = std::find_if(presets.begin(), presets.end(),
                                     [&](const auto& p) { return p.name == camera.preset; });
    if (preset == presets.end())
        return findings.add(camera.entry, "preset",
                            fmt::format("there is no preset '{}'", clipped(camera.preset)),
                            fmt::format("use one of: {}", fmt::join(names, ", ")));
    const std::tuple<const char*, const char*, bool> asked[]{
        {"chunks", "chunks", camera.chunks.value_or(false)},
        {"ptp", "ptp", camera.ptp},
        {"trigger", "action", camera.trigger == TriggerSource::ptp},
        {"exposure", "pulse_width", camera.exposure_by_pulse}};
    for (const auto& [key, group, wanted] : asked)
        if (wanted && preset->groups.at(group).empty())
            findings.add(camera.entry, key,
                         fmt::format("the preset '{}' does not support '{}'", preset->name, group),
                         "remove the key, or set the features by name in [camera.features]");
}

void check_presets(const Configuration& configuration, Findings& findings) {
    if (configuration.cameras.empty()) return;
    const auto presets = load_presets(preset_directory(configuration));
    if (!presets) {
        const Error& error = presets.error();
        return findings.add(configuration.entry, "preset_directory",
                            error.where + ": " + error.what, error.cure);
    }
    for (const CameraConfiguration& camera : configuration.cameras)
        check_preset(camera, *presets, findings);
}

/// The bus of a part, and its lines.
void check_imu_wiring(const ImuConfiguration& imu, Findings& findings) {
    const imu::ImuModel& model = *imu.model;
    const bool serial = imu.port() == 1;
    const bool has_i2c = model.fastest_i2c_hz > 0;
    if (imu.entry.has("bus") && serial)
        findings.add(imu.entry, "bus", fmt::format("the {} is always on the UART", model.name),
                     "remove the key");
    else if (imu.bus == ImuBus::i2c && !has_i2c)
        findings.add(imu.entry, "bus", fmt::format("the {} is not supported on I2C", model.name),
                     "set bus = \"spi\"; only the icm42688p can be on I2C");
    else if (imu.bus == ImuBus::i2c && !imu.data_ready)
        findings.add(imu.entry, "bus",
                     "reads over I2C are slow, so the data-ready line must start them",
                     "wire that line and set data_ready = true, or connect the part to SPI");
    if (imu.entry.has("i2c_address") && imu.bus != ImuBus::i2c)
        findings.add(imu.entry, "i2c_address", "'i2c_address' is only for a part on I2C",
                     has_i2c ? "set bus = \"i2c\", or remove the key" : "remove the key");
    if (imu.i2c_address != first_i2c_address && imu.i2c_address != second_i2c_address)
        findings.add(imu.entry, "i2c_address",
                     fmt::format("'i2c_address' is 0x{:02X}, but must be 0x{:02X} or 0x{:02X}",
                                 imu.i2c_address, first_i2c_address, second_i2c_address),
                     "the address pin of the part selects which");
    if (!imu.accel_ready) return;
    if (!model.accel_ready)
        findings.add(
            imu.entry, "accel_ready",
            fmt::format("the {} has no separate data-ready line for its accelerometer", model.name),
            "remove the key; only the bmi088 has one");
    else if (!imu.data_ready)
        findings.add(imu.entry, "accel_ready",
                     "'accel_ready' needs the data-ready line of the gyro, which paces the samples",
                     "wire that line and set data_ready = true, or remove the key");
}

void check_imus(const Configuration& configuration, Findings& findings) {
    for (const ImuConfiguration& imu : configuration.imus) {
        const imu::ImuModel& model = *imu.model;
        check_imu_wiring(imu, findings);
        if (imu.bus == ImuBus::i2c && model.fastest_i2c_hz > 0)
            findings.limit(imu.entry, "rate_hz", imu.rate_hz, model.fastest_i2c_hz,
                           fmt::format("the maximum of the {} on I2C", model.name),
                           "lower it, or connect the part to SPI");
        findings.limit(imu.entry, "rate_hz", imu.rate_hz, model.fastest_hz,
                       fmt::format("the maximum of the {}", model.name), "lower it");
        if (!imu.data_ready)
            findings.limit(imu.entry, "rate_hz", imu.rate_hz, fastest_on_grid_hz,
                           "without the data-ready line",
                           "lower it, or wire that line and set data_ready = true");
        findings.limit(imu.entry, "filter", imu.filter, model.strongest_filter,
                       fmt::format("the maximum of the {}", model.name), "lower it");
    }
    find_repeated(
        configuration.imus,
        [](const ImuConfiguration& a, const ImuConfiguration& b) { return a.port() == b.port(); },
        [&](const ImuConfiguration& first, const ImuConfiguration& second) {
            findings.add(
                second.entry, "model",
                fmt::format("the board has one IMU port on {}, already used by {}",
                            second.port() == 0 ? "SPI or I2C" : "the UART",
                            at_line(first.entry, second.entry)),
                "remove one of the two tables; a vn100 is on the UART, all others are on SPI or "
                "I2C");
        });
}

void check_illumination(const Configuration& configuration, Findings& findings) {
    for (const std::string& name : configuration.illumination.cameras)
        if (find_triggered_camera(configuration, name) == nullptr)
            findings.add(configuration.illumination.entry, "cameras",
                         fmt::format("'{}' is not a camera that the board triggers", clipped(name)),
                         "use the 'name' of a [[camera]]");
}

void check_inputs(const Configuration& configuration, Findings& findings) {
    const PortConfiguration& ports = configuration.ports;
    for (const auto& [key, names] :
         {std::pair("inputs", &ports.inputs), {"falling", &ports.falling}})
        for (const std::string& name : *names)
            if (!contains(pulse_input_names, name))
                findings.add(ports.entry, key, fmt::format("'{}' is not an input", clipped(name)),
                             fmt::format("use any of: {}", fmt::join(pulse_input_names, ", ")));
    for (const std::string& name : ports.falling)
        if (!contains(ports.inputs, name))
            findings.add(ports.entry, "falling",
                         fmt::format("the input '{}' is not enabled", clipped(name)),
                         "add it to 'inputs', or remove it");
}

void check_uart_and_imu_output(const Configuration& configuration, Findings& findings) {
    const PortConfiguration& ports = configuration.ports;
    if (ports.nmea && !contains(ports.inputs, "pps"))
        findings.add(ports.entry, "nmea",
                     "'nmea' labels the pulses of the PPS input, which is not enabled",
                     "add \"pps\" to 'inputs'");
    if (ports.nmea && find_imu_at(configuration, 1) != nullptr)
        findings.add(ports.entry, "nmea", "'nmea' needs the UART, which the vn100 uses",
                     "remove one of the two");
    if (ports.imu_output && find_imu_at(configuration, 0) == nullptr)
        findings.add(ports.entry, "imu_output", "'imu_output' needs an IMU on SPI or I2C",
                     "add an [[imu]] of any model but vn100, or remove the key");
}

/// Outputs that nothing else uses, as `test_output` names them.
std::vector<std::string> free_test_outputs(const Configuration& configuration) {
    std::vector<std::string> free{"test"};
    if (configuration.ports.sync_rate_hz == 0) free.emplace_back("sync");
    for (unsigned output = 0; output < wire::camera_count; ++output)
        if (find_camera_at(configuration, output) == nullptr)
            free.push_back(fmt::format("trigger{}", output));
    return free;
}

/// Pulses of a rate of their own.
void check_test_rate(const Configuration& configuration, Findings& findings) {
    const PortConfiguration& ports = configuration.ports;
    if (ports.test_rate_hz == 0 && ports.test_output != wire::test_at_test)
        findings.add(ports.entry, "test_output",
                     "'test_output' has no effect without 'test_rate_hz'",
                     "set 'test_rate_hz', or remove the key");
    if (ports.test_rate_hz == 0) return;
    if (ports.test_rate_hz < slowest_test_hz)
        findings.add(ports.entry, "test_rate_hz",
                     "'test_rate_hz' must be 0 (no pulses), or 0.1 to 10000 Hz",
                     "raise it, or set it to 0", TomlRange{slowest_test_hz, fastest_test_hz});
    if (!ports.test.empty())
        findings.add(
            ports.entry, "test_rate_hz",
            fmt::format("the test output already shows '{}' ('test')", clipped(ports.test)),
            "remove one of the two keys");
    if (ports.test_output == wire::test_at_sync && ports.sync_rate_hz != 0)
        findings.add(ports.entry, "test_output", "the sync output is used by 'sync_rate_hz'",
                     "set sync_rate_hz = 0, or choose another output");
    if (ports.test_output < wire::test_at_camera0 || ports.test_output >= wire::test_at_sync)
        return;
    const unsigned output = ports.test_output - unsigned{wire::test_at_camera0};
    if (const CameraConfiguration* camera = find_camera_at(configuration, output))
        findings.add(
            ports.entry, "test_output",
            fmt::format("output {} is already used by {}", output,
                        at_line(camera->entry, ports.entry)),
            fmt::format("free outputs: {}", fmt::join(free_test_outputs(configuration), ", ")));
}

void check_pulse_outputs(const Configuration& configuration, Findings& findings) {
    const PortConfiguration& ports = configuration.ports;
    if (ports.sync_rate_hz != 0 && ports.sync_rate_hz < slowest_sync_hz)
        findings.add(ports.entry, "sync_rate_hz",
                     "'sync_rate_hz' must be 0 (no pulses), or 0.1 to 10 Hz",
                     "raise it, or set it to 0", TomlRange{slowest_sync_hz, fastest_sync_hz});
    if (ports.follow_sync && !contains(ports.inputs, "sync"))
        findings.add(ports.entry, "follow_sync",
                     "'follow_sync' needs the pulses of the sync input, which is not enabled",
                     "add \"sync\" to 'inputs'");
    if (ports.follow_sync && configuration.clock.align)
        findings.add(ports.entry, "follow_sync",
                     "the grid cannot follow sync pulses and, by 'align' of [clock], the output "
                     "clock",
                     "remove one of the two keys");
    const ImuConfiguration* uart = find_imu_at(configuration, 1);
    if (!test_source(configuration))
        findings.add(
            ports.entry, "test",
            fmt::format("'{}' is neither a triggered camera nor an IMU", clipped(ports.test)),
            "use the 'name' of a [[camera]] or [[imu]], or \"\" for none");
    else if (uart != nullptr && uart->name == ports.test && !uart->data_ready)
        findings.add(ports.entry, "test",
                     "without its data-ready line, the samples of a vn100 cannot be shown",
                     "wire that line and set data_ready = true, or choose another 'test'");
    if (const double rate = test_pulse_rate_hz(configuration); rate != 0)
        findings.limit(ports.entry, "pulse_us", ports.pulse_us, 1e6 / rate / 2,
                       ports.test.empty()
                           ? std::string("half the period of 'test_rate_hz'")
                           : fmt::format("half the period of '{}', which 'test' shows", ports.test),
                       "lower it");
}

constexpr void (*rules[])(const Configuration&, Findings&){check_instance,
                                                           check_link,
                                                           check_pps,
                                                           check_names,
                                                           check_devices,
                                                           check_outputs,
                                                           check_masters,
                                                           check_camera_times,
                                                           check_ptp,
                                                           check_line_delays,
                                                           check_exposure_features,
                                                           check_glitch,
                                                           check_auto_exposure,
                                                           check_paths,
                                                           check_presets,
                                                           check_imus,
                                                           check_illumination,
                                                           check_inputs,
                                                           check_uart_and_imu_output,
                                                           check_test_rate,
                                                           check_pulse_outputs,
                                                           check_history,
                                                           check_receive,
                                                           check_time_outputs};

}  // namespace

double longest_arrival_ms(const CameraConfiguration& camera) {
    const double kept =
        static_cast<double>(pairing::longest_latest_arrival(period_of(camera)).ns) * 1e-6;
    return camera.camera_clock ? kept : std::min(kept, longest_arrival_without_clock_ms);
}

void add_problems(const Configuration& configuration, TomlProblems& problems) {
    Findings findings(problems);
    for (const auto rule : rules) rule(configuration, findings);
    std::stable_sort(problems.begin(), problems.end(), [](const auto& a, const auto& b) {
        return std::tie(a.place.path, a.place.line, a.place.column) <
               std::tie(b.place.path, b.place.line, b.place.column);
    });
}

}  // namespace versavis::daemon
