// SPDX-License-Identifier: BSD-3-Clause
#include "board_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <utility>

#include "engine/board/board_words.hpp"

namespace versavis::daemon {

namespace {

using Part = wire::ConfigurationPart;

/// One part that the configuration asks for.
struct Need {
    std::uint32_t part;  ///< bit of wire::Present
    Part where;
    unsigned index;  ///< of the camera or IMU in the board's configuration
    const TomlEntry* entry;
    std::string key;
    std::string asks;   ///< what stands there, as "is 2"
    std::string what;   ///< the part, as "output 2"
    std::string there;  ///< what the board has in its place; empty: nothing
    std::string cure;
};

bool has(std::uint32_t present, std::uint32_t part) { return (present & part) != 0; }

/// "a", "a and b", "a, b and c".
std::string enumeration(const std::vector<std::string>& words) {
    if (words.size() < 2) return words.empty() ? "" : words.front();
    return fmt::format("{} and {}", fmt::join(words.begin(), words.end() - 1, ", "), words.back());
}

/// After its word, which has a plural in s; empty: there are none.
std::string counted(const char* word, const std::vector<std::string>& of) {
    return of.empty() ? ""
                      : fmt::format("{}{} {}", word, of.size() == 1 ? "" : "s", enumeration(of));
}

std::string outputs_there(std::uint32_t present) {
    std::vector<std::string> outputs;
    for (unsigned i = 0; i < wire::camera_count; ++i)
        if (has(present, wire::present_camera0 << i)) outputs.push_back(std::to_string(i));
    return counted("output", outputs);
}

std::string inputs_there(std::uint32_t present) {
    std::vector<std::string> inputs;
    for (unsigned i = 0; i < wire::pulse_input_count; ++i)
        if (has(present, wire::present_pulse0 << i)) inputs.push_back(pulse_input_names[i]);
    return counted("input", inputs);
}

std::string buses_there(std::uint32_t present) {
    std::vector<std::string> buses;
    if (has(present, wire::present_spi)) buses.emplace_back("SPI");
    if (has(present, wire::present_i2c)) buses.emplace_back("I2C");
    if (has(present, wire::present_uart)) buses.emplace_back("a UART");
    return buses.empty() ? "" : enumeration(buses) + " for IMUs";
}

/// What the configuration asks for, gathered in the order of its tables.
class Needs {
 public:
    explicit Needs(std::uint32_t present) : present_(present) {}

    void of_camera(const CameraConfiguration& camera);
    void of_imu(const ImuConfiguration& imu);
    void of_light(const IlluminationConfiguration& light);
    void of_ports(const PortConfiguration& ports);
    void of_time_output(const TimeOutputConfiguration& output);
    void of_board(const BoardConfiguration& board);

    std::vector<Need> take() { return std::move(needs_); }

 private:
    void of_test_pulses(const PortConfiguration& ports);

    std::uint32_t present_;
    std::vector<Need> needs_;
};

void Needs::of_camera(const CameraConfiguration& camera) {
    if (camera.trigger != TriggerSource::board) return;
    needs_.push_back({wire::present_camera0 << camera.output, Part::camera, camera.output,
                      &camera.entry, "output", fmt::format("is {}", camera.output),
                      fmt::format("output {}", camera.output), outputs_there(present_),
                      "use one that it has, or another board"});
}

void Needs::of_imu(const ImuConfiguration& imu) {
    const unsigned port = imu.port();
    const bool i2c = imu.bus == ImuBus::i2c;
    const auto need = [&](std::uint32_t part, const char* key, std::string asks, const char* what,
                          std::string there, std::string cure) {
        needs_.push_back({part, Part::imu, port, &imu.entry, key, std::move(asks), what,
                          std::move(there), std::move(cure)});
    };
    if (port == 1) {
        need(wire::present_uart, "model", fmt::format("is \"{}\"", imu.model->name),
             "UART for IMUs", buses_there(present_), "use another part, or another board");
    } else {
        const bool other = i2c || imu.model->fastest_i2c_hz > 0;
        const bool has_other = has(present_, i2c ? wire::present_spi : wire::present_i2c);
        need(i2c ? wire::present_i2c : wire::present_spi, "bus",
             fmt::format("is \"{}\"", i2c ? "i2c" : "spi"), i2c ? "I2C for IMUs" : "SPI for IMUs",
             buses_there(present_),
             other && has_other
                 ? fmt::format("set bus = \"{}\" and rewire the part, or use another "
                               "board",
                               i2c ? "spi" : "i2c")
                 : std::string("use another part, or another board"));
    }
    if (imu.data_ready)
        need(wire::present_ready0 << port, "data_ready", "is true", "data-ready input for it", "",
             "set data_ready = false, or use another board");
    if (imu.accel_ready)
        need(wire::present_accel_ready, "accel_ready", "is true",
             "data-ready input for its accelerometer", "",
             "set accel_ready = false, or use another board");
}

void Needs::of_light(const IlluminationConfiguration& light) {
    if (light.cameras.empty()) return;
    needs_.push_back({wire::present_light, Part::illumination, 0, &light.entry, "cameras",
                      fmt::format("is {}", light.cameras), "light output", "",
                      "set cameras = [], or use another board"});
}

void Needs::of_test_pulses(const PortConfiguration& ports) {
    const auto need = [&](std::uint32_t part, const char* key, std::string asks, std::string what,
                          std::string there, const char* cure) {
        needs_.push_back({part, Part::ports, 0, &ports.entry, key, std::move(asks), std::move(what),
                          std::move(there), cure});
    };
    if (!ports.test.empty())
        return need(wire::present_test_output, "test", fmt::format("is \"{}\"", ports.test),
                    "test output", "", "set test = \"\", or use another board");
    if (ports.test_rate_hz == 0) return;
    if (ports.test_output == wire::test_at_test)
        return need(wire::present_test_output, "test_rate_hz",
                    "is " + quantity("test_rate_hz", ports.test_rate_hz), "test output", "",
                    "choose another 'test_output', or use another board");
    if (ports.test_output == wire::test_at_sync)
        return need(wire::present_sync_output, "test_output", "is \"sync\"", "sync output", "",
                    "choose another output, or use another board");
    const unsigned output = ports.test_output - unsigned{wire::test_at_camera0};
    need(wire::present_camera0 << output, "test_output", fmt::format("is \"trigger{}\"", output),
         fmt::format("output {}", output), outputs_there(present_),
         "choose one that it has, or use another board");
}

void Needs::of_ports(const PortConfiguration& ports) {
    const auto need = [&](std::uint32_t part, const char* key, std::string asks, std::string what,
                          std::string there, const char* cure) {
        needs_.push_back({part, Part::ports, 0, &ports.entry, key, std::move(asks), std::move(what),
                          std::move(there), cure});
    };
    for (unsigned i = 0; i < wire::pulse_input_count; ++i) {
        const std::string& name = pulse_input_names[i];
        if (std::find(ports.inputs.begin(), ports.inputs.end(), name) != ports.inputs.end())
            need(wire::present_pulse0 << i, "inputs", fmt::format("has \"{}\"", name),
                 "input " + name, inputs_there(present_), "remove it, or use another board");
    }
    if (ports.imu_output)
        need(wire::present_imu_output, "imu_output", "is true", "IMU output", "",
             "set imu_output = false, or use another board");
    if (ports.nmea)
        need(wire::present_uart, "nmea", "is true", "UART", "",
             "set nmea = false, or use another board");
    of_test_pulses(ports);
    if (ports.sync_rate_hz != 0)
        need(wire::present_sync_output, "sync_rate_hz",
             "is " + quantity("sync_rate_hz", ports.sync_rate_hz), "sync output", "",
             "set sync_rate_hz = 0, or use another board");
}

void Needs::of_time_output(const TimeOutputConfiguration& output) {
    const auto need = [&](std::uint32_t part, const char* key, std::string asks, std::string what,
                          std::string there, const char* cure) {
        needs_.push_back({part, Part::ports, 0, &output.entry, key, std::move(asks),
                          std::move(what), std::move(there), cure});
    };
    const std::string& name = output_name(output.output);
    const bool trigger = output.output != wire::test_at_test && output.output != wire::test_at_sync;
    const std::uint32_t part =
        trigger ? wire::present_camera0 << (output.output - unsigned{wire::test_at_camera0})
                : std::uint32_t{output.output == wire::test_at_test ? wire::present_test_output
                                                                    : wire::present_sync_output};
    need(part, "output", fmt::format("is \"{}\"", name), "output " + name,
         trigger ? outputs_there(present_) : "", "choose another output, or use another board");
    if (!output.sentences.empty())
        need(wire::present_uart, "sentences", fmt::format("is {}", output.sentences), "UART", "",
             "set sentences = [], or use another board");
}

void Needs::of_board(const BoardConfiguration& board) {
    if (board.keep_configuration)
        needs_.push_back({wire::present_memory, Part::ports, 0, &board.entry, "keep_configuration",
                          "is true", "memory to store it", "",
                          "set keep_configuration = false, or use another board"});
}

/// What the configuration asks for; `present`: what there is to choose from.
std::vector<Need> needs_of(const Configuration& configuration, std::uint32_t present) {
    Needs needs(present);
    needs.of_board(configuration.board);
    for (const CameraConfiguration& camera : configuration.cameras) needs.of_camera(camera);
    for (const ImuConfiguration& imu : configuration.imus) needs.of_imu(imu);
    needs.of_light(configuration.illumination);
    needs.of_ports(configuration.ports);
    for (const TimeOutputConfiguration& output : configuration.time_outputs)
        needs.of_time_output(output);
    return needs.take();
}

/// With what distinguishes it from others.
std::string name_of(const wire::BoardHello& board) {
    std::vector<std::string> facts;
    if (board.firmware[0] != 0) facts.push_back(board::text(board.firmware));
    if (board.serial[0] != 0) facts.push_back("serial " + board::text(board.serial));
    return facts.empty() ? "the board" : fmt::format("the board ({})", fmt::join(facts, ", "));
}

std::string message(const Need& need, const std::string& board) {
    return fmt::format("{} {}: {} has {}; {}", need.entry->reference(need.key), need.asks, board,
                       need.there.empty() ? "no " + need.what : need.there, need.cure);
}

/// What the board refuses as a part that it lacks.
bool means(const wire::Refusal& refusal, const Need& need) {
    return refusal.part == need.where && refusal.index == need.index && refusal.value >= 0 &&
           refusal.value < std::int64_t{board::part_count} &&
           need.part == 1U << static_cast<unsigned>(refusal.value);
}

}  // namespace

std::vector<std::string> missing_parts(const Configuration& configuration,
                                       const wire::BoardHello& board) {
    std::vector<std::string> missing;
    for (const Need& need : needs_of(configuration, board.present))
        if (!has(board.present, need.part)) missing.push_back(message(need, name_of(board)));
    return missing;
}

std::string describe_missing(const Configuration& configuration, const wire::Refusal& refusal) {
    const std::vector<Need> needs = needs_of(configuration, 0);
    const auto need = std::find_if(needs.begin(), needs.end(),
                                   [&](const Need& one) { return means(refusal, one); });
    if (need == needs.end())
        return "the board reports a missing part that the configuration does not use: update its "
               "firmware";
    return message(*need, "the board");
}

std::string missing_capability(const Configuration& configuration, std::uint32_t capabilities) {
    const auto lacks = [](const TomlEntry& entry, const char* key, const char* what) {
        return fmt::format(
            "{} is true: the board's firmware does not support {}; update it, or set {} = false",
            entry.reference(key), what, key);
    };
    if (configuration.clock.align && !has(capabilities, wire::capability_host_grid))
        return lacks(configuration.clock.entry, "align", "moving its grid");
    if (configuration.ports.follow_sync && !has(capabilities, wire::capability_grid_on_sync))
        return lacks(configuration.ports.entry, "follow_sync", "following another board");
    if (configuration.ports.nmea && !has(capabilities, wire::capability_nmea))
        return lacks(configuration.ports.entry, "nmea", "NMEA");
    if (!configuration.time_outputs.empty() && !has(capabilities, wire::capability_time_output))
        return configuration.time_outputs.front().entry.reference("name") +
               ": the board's firmware has no time outputs; update it, or remove the table";
    return "";
}

}  // namespace versavis::daemon
