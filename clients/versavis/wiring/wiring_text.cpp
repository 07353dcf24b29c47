// SPDX-License-Identifier: BSD-3-Clause
#include "wiring/wiring_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/wrapped_line.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

constexpr auto rules =
    "A pin of the board takes 0 to 3.3 V, and more destroys it. Each buffer needs 100 nF at its\n"
    "supply. Tie the inputs of unused gates to ground. Never plug or unplug with the power on.\n"
    "When all is wired: versavis camera check, and versavis lidar check\n";

std::string row(const char* title, const std::string& text) {
    constexpr std::size_t text_column = 12;
    return client::wrapped(fmt::format("  {:<10}{}", title, text), text_column);
}

std::string board_pin(const std::string& signal) {
    const BoardPins& board = circuits().board;
    if (signal == "ground") return fmt::format("board pin {} (ground)", board.ground_pin);
    if (const auto rail = board.rails.find(signal); rail != board.rails.end())
        return fmt::format("board pin {} ({})", rail->second.pin, signal);
    const BoardPin& pin = board.signals.at(signal);
    return fmt::format("board pin {} (GP{}, {})", pin.pin, pin.gpio, signal);
}

std::string camera_pin(int pin, const std::string& line) {
    return pin == 0 ? fmt::format("camera {} (pin: see its manual)", line)
                    : fmt::format("camera pin {} ({})", pin, line);
}

/// From an output of the board to an input at `pin` of a `device`; `high`: it rests there.
std::string output_rows(const char* title, const std::string& signal, const TriggerWiring& wiring,
                        bool high, const char* device, const std::string& pin) {
    const TriggerCircuit& circuit = wiring.circuit;
    const Driver& driver = *circuits().driver(circuit.driver);
    const std::string gates = circuit.gates == 1
                                  ? driver.name
                                  : fmt::format("{} gates of {}", circuit.gates, driver.name);
    std::string rows =
        row(title,
            fmt::format("{} -> {} -> {}", board_pin(signal), gates, ohms(circuit.series_ohm))) +
        row("", "-> " + pin) +
        row("", fmt::format("{} from {} to {}", ohms(circuit.rest_ohm), board_pin(signal),
                            board_pin(high ? "3.3 V" : "ground"))) +
        row("", fmt::format("supply of {}: {}{}{}", driver.name, board_pin(driver.rail),
                            driver.ties.empty() ? "" : "; ", driver.ties));
    return rows + row("", fmt::format("{}: {}", device, figures(wiring.input)));
}

std::string trigger_rows(const WiredCamera& camera) {
    const TriggerWiring& trigger = camera.circuit->trigger;
    return output_rows("trigger", fmt::format("trigger{}", camera.output), trigger,
                       camera.inverted || trigger.circuit.rest == "high", "camera",
                       camera_pin(trigger.pin, trigger.line));
}

std::string exposure_rows(const WiredCamera& camera) {
    if (!camera.exposure_line) return row("exposure", "not wired: strobe = \"none\"");
    const ExposureWiring& exposure = camera.circuit->exposure;
    const ExposureCircuit& circuit = exposure.circuit;
    const std::string from = camera_pin(exposure.pin, exposure.line);
    const std::string signal = fmt::format("exposure{}", camera.output);
    std::string rows =
        row("exposure",
            fmt::format("{} -> {}{}", from, circuit.buffer.empty() ? "" : circuit.buffer + " -> ",
                        board_pin(signal)));
    if (circuit.pull_up_ohm != 0)
        rows += row("", fmt::format("{} from {} to {}", ohms(circuit.pull_up_ohm), from,
                                    board_pin("3.3 V")));
    if (!circuit.buffer.empty())
        rows += row("", fmt::format("supply of {}: {}", circuit.buffer, board_pin("3.3 V")));
    return rows + row("", "camera: " + figures(exposure.output));
}

std::string camera_text(const WiredCamera& camera) {
    const std::string name = camera.name.empty() ? "" : camera.name + ": ";
    if (camera.circuit == nullptr) return client::wrapped(name + camera.problem, 2);
    const CameraCircuit& circuit = *camera.circuit;
    std::string text =
        fmt::format("{}{}\n", name, circuit.title) + row("connector", circuit.connector) +
        trigger_rows(camera) + exposure_rows(camera) +
        row("ground", fmt::format("{} - {}", board_pin("ground"),
                                  camera_pin(circuit.ground_pin, "ground of these lines")));
    for (const UnusedPin& unused : circuit.not_wired)
        text += row("not wired", camera_pin(unused.pin, unused.what));
    if (!circuit.unknown.empty())
        text += row("!", fmt::format("See the camera's manual for {}.", circuit.unknown));
    for (const std::string& note : circuit.notes) text += row("!", note);
    return text + row("source", circuit.source);
}

std::string imu_text(const WiredImu& imu) {
    const std::string name = imu.name.empty() ? "" : imu.name + ": ";
    if (imu.circuit == nullptr) return client::wrapped(name + imu.problem, 2);
    std::string text = fmt::format("{}{}\n", name, imu.circuit->title);
    for (const ImuWire& wire : imu.circuit->wires) {
        std::string line = fmt::format("{} - ", wire.imu);
        if (wire.series_ohm != 0) line += ohms(wire.series_ohm) + " - ";
        line += board_pin(wire.board);
        if (wire.pull_up_ohm != 0)
            line += fmt::format("; {} to {}", ohms(wire.pull_up_ohm), board_pin("3.3 V"));
        text += row("wire", line);
    }
    for (const std::string& note : imu.circuit->notes) text += row("!", note);
    if (!imu.data_ready) text += row("!", "With the data-ready line wired, set data_ready = true.");
    return text + row("!", "Wires shorter than 20 cm.") + row("source", imu.circuit->source);
}

std::string lidar_pin(const TriggerWiring& wiring) {
    return wiring.pin == 0 ? "LiDAR " + wiring.line
                           : fmt::format("LiDAR pin {} ({})", wiring.pin, wiring.line);
}

std::string lidar_text(const WiredLidar& lidar) {
    const std::string name = lidar.name.empty() ? "" : lidar.name + ": ";
    if (lidar.circuit == nullptr) return client::wrapped(name + lidar.problem, 2);
    const LidarCircuit& circuit = *lidar.circuit;
    std::string text = fmt::format("{}{}\n", name, circuit.title) +
                       row("connector", circuit.connector) +
                       output_rows("pulse", lidar.output, circuit.pulse, lidar.pulse_inverted,
                                   "LiDAR", lidar_pin(circuit.pulse));
    text += lidar.sentences
                ? output_rows("serial", "uart_transmit", circuit.serial, !lidar.serial_inverted,
                              "LiDAR", lidar_pin(circuit.serial))
                : row("serial", "not wired: sentences = []");
    text += row("ground", fmt::format("{} - LiDAR {}", board_pin("ground"), circuit.ground));
    if (!circuit.unknown.empty())
        text += row("!", fmt::format("See the LiDAR's manual for {}.", circuit.unknown));
    if (const std::string shared = shared_line_warning(lidar); !shared.empty())
        text += row("!", shared);
    for (const std::string& note : circuit.notes) text += row("!", note);
    return text + row("source", circuit.source);
}

/// A row of the table by its name.
json table_row(const char* group, const std::string& name) {
    for (const json& each : circuits_json().at(group))
        if (each.at("name") == name) return each;
    return {};
}

template <class Part>
json part_json(const char* group, const Part& part) {
    json one{{"name", part.name}, {"problem", part.problem}};
    one["circuit"] = part.circuit == nullptr ? json() : table_row(group, part.circuit->name);
    return one;
}

}  // namespace

std::string wiring_text(const WiredParts& parts) {
    std::string text;
    for (const WiredCamera& camera : parts.cameras) text += camera_text(camera) + "\n";
    for (const WiredImu& imu : parts.imus) text += imu_text(imu) + "\n";
    for (const WiredLidar& lidar : parts.lidars) text += lidar_text(lidar) + "\n";
    return text + fmt::format("The board is a {}.\n", circuits().board.name) + rules;
}

json wiring_json(const WiredParts& parts) {
    json all{{"board", circuits_json().at("board")},
             {"drivers", circuits_json().at("drivers")},
             {"cameras", json::array()},
             {"imus", json::array()},
             {"lidars", json::array()}};
    for (const WiredCamera& camera : parts.cameras) {
        json one = part_json("cameras", camera);
        one["output"] = camera.output;
        one["trigger_inverted"] = camera.inverted;
        one["exposure_line"] = camera.exposure_line;
        all["cameras"].push_back(one);
    }
    for (const WiredImu& imu : parts.imus) all["imus"].push_back(part_json("imus", imu));
    for (const WiredLidar& lidar : parts.lidars) {
        json one = part_json("lidars", lidar);
        one["output"] = lidar.output;
        one["pulse_inverted"] = lidar.pulse_inverted;
        one["serial_inverted"] = lidar.serial_inverted;
        one["sentences"] = lidar.sentences;
        one["sentences_of"] = lidar.sentences_of.empty() ? lidar.name : lidar.sentences_of;
        all["lidars"].push_back(one);
    }
    return all;
}

std::string circuits_text() {
    std::string text;
    for (const CameraCircuit& circuit : circuits().cameras)
        text += fmt::format("{:<14} {}\n", circuit.name, circuit.title);
    for (const ImuCircuit& circuit : circuits().imus)
        text += fmt::format("{:<14} {}\n", circuit.name, circuit.title);
    for (const LidarCircuit& circuit : circuits().lidars)
        text += fmt::format("{:<14} {}\n", circuit.name, circuit.title);
    return text;
}

}  // namespace versavis::client
