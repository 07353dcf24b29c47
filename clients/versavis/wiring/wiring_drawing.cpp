// SPDX-License-Identifier: BSD-3-Clause
#include "wiring/wiring_drawing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/markup_text.hpp"

namespace versavis::client {

namespace {

constexpr int width = 860;
constexpr int board_left = 20;
constexpr int board_right = 190;
constexpr int device_left = 560;
constexpr int device_right = 840;
constexpr int pin_pitch = 26;
constexpr int cameras_of_board = 4;
/// Characters that fit below a drawing.
constexpr std::size_t note_columns = 130;

const char* colour(const std::string& kind) {
    if (kind == "output") return "#c0392b";
    if (kind == "input") return "#1f618d";
    if (kind == "bus") return "#196f3d";
    return kind == "supply" ? "#777" : "#000";
}

/// Of the board: what a signal is there.
std::string kind_of(const std::string& signal) {
    const auto begins = [&](const char* with) { return signal.rfind(with, 0) == 0; };
    if (begins("trigger") || begins("sync_output") || begins("test_output") || begins("light"))
        return "output";
    return begins("uart") || begins("i2c") || begins("spi") ? "bus" : "input";
}

std::string text(int x, int y, const std::string& what, const char* fill = "#000",
                 const char* anchor = "start", int size = 12) {
    const std::string sized = size == 12 ? "" : fmt::format(" font-size=\"{}\"", size);
    return fmt::format(R"(<text x="{}" y="{}" text-anchor="{}" fill="{}"{}>{}</text>)", x, y,
                       anchor, fill, sized, markup_text(what));
}

std::string box(int left, int right, int top, int bottom, const char* fill) {
    return fmt::format(R"(<rect x="{}" y="{}" width="{}" height="{}" rx="8" fill="{}" )"
                       R"(stroke="#555"/>)",
                       left, top, right - left, bottom - top, fill);
}

std::string dot(int x, int y) {
    return fmt::format(R"(<circle cx="{}" cy="{}" r="3" fill="#333"/>)", x, y);
}

std::string pin_circle(int x, int y, const char* fill) {
    return fmt::format(R"(<circle cx="{}" cy="{}" r="5" fill="{}"/>)", x, y, fill);
}

std::string named_level(const std::string& level) {
    const auto& rails = circuits().board.rails;
    const auto rail = rails.find(level);
    return rail == rails.end() ? level : fmt::format("{}, pin {}", level, rail->second.pin);
}

std::string other_cameras() {
    const auto& signals = circuits().board.signals;
    std::vector<std::string> pairs;
    for (int i = 1; i < cameras_of_board; ++i)
        pairs.push_back(fmt::format("{} and {}", signals.at(fmt::format("trigger{}", i)).pin,
                                    signals.at(fmt::format("exposure{}", i)).pin));
    return fmt::format("Cameras 1, 2, 3 are the same at pins {} of the Pico.",
                       fmt::join(pairs, ", "));
}

std::string with_name(const std::string& name, const std::string& title) {
    return name.empty() ? title : name + ": " + title;
}

}  // namespace

void Sheet::wire(int x, int y, int to_x, int to_y) {
    add(fmt::format(R"(<polyline points="{},{} {},{}" fill="none" stroke="#333" )"
                    R"(stroke-width="1.5"/>)",
                    x, y, to_x, to_y));
}

/// Its middle is at x, y.
void Sheet::resistor(int x, int y, int ohm, bool upright) {
    const int wide = upright ? 12 : 40;
    const int high = upright ? 32 : 12;
    add(fmt::format(R"(<rect x="{}" y="{}" width="{}" height="{}" fill="white" stroke="#333" )"
                    R"(stroke-width="1.5"/>)",
                    x - wide / 2, y - high / 2, wide, high));
    add(upright ? text(x + 11, y + 4, ohms(ohm)) : text(x, y - 11, ohms(ohm), "#000", "middle"));
}

/// A resistor from the wire at y to a rail, which is above or below.
void Sheet::to_level(int x, int y, int ohm, const std::string& level, bool up) {
    const int sign = up ? -1 : 1;
    const int end = y + sign * 58;
    add(dot(x, y));
    wire(x, y, x, end);
    resistor(x, y + sign * 30, ohm, true);
    wire(x - 9, end, x + 9, end);
    add(text(x, end + (up ? -6 : 14), named_level(level), "#777", "middle"));
}

/// A buffer; its input is at one side, its output at the other.
void Sheet::gate(int x, int y, const std::string& name, const std::string& rail,
                 const std::string& ties, bool to_right) {
    const int tip = to_right ? x + 20 : x - 20;
    const int back = to_right ? x - 20 : x + 20;
    add(fmt::format(R"(<polygon points="{},{} {},{} {},{}" fill="#fff8e0" stroke="#333" )"
                    R"(stroke-width="1.5"/>)",
                    back, y - 20, back, y + 20, tip, y));
    add(text(x, y - 26, name, "#000", "middle"));
    add(text(x, y + 34, named_level(rail), "#777", "middle"));
    if (!ties.empty()) add(text(x, y + 48, ties, "#777", "middle"));
}

void Sheet::board_pin(int y, const std::string& signal) {
    const BoardPins& board = circuits().board;
    std::string label;
    std::string kind = "supply";
    if (signal == "ground") {
        label = fmt::format("{}", board.ground_pin);
    } else if (const auto rail = board.rails.find(signal); rail != board.rails.end()) {
        label = fmt::format("{}", rail->second.pin);
    } else {
        const BoardPin& pin = board.signals.at(signal);
        label = fmt::format("GP{} {}", pin.gpio, pin.pin);
        kind = kind_of(signal);
    }
    add(pin_circle(board_right - 6, y, colour(kind)));
    add(text(board_right - 18, y + 4, label, "#555", "end"));
    add(text(board_left + 12, y + 4, signal, colour(kind)));
}

void Sheet::device_pin(int y, int number, const std::string& name, const std::string& below,
                       const std::string& kind) {
    add(pin_circle(device_left + 6, y, colour(kind)));
    add(text(device_left + 18, y + 4, number == 0 ? name : fmt::format("pin {}, {}", number, name),
             colour(kind)));
    if (!below.empty()) add(text(device_left + 18, y + 18, below, "#555", "start", 11));
}

void Sheet::open_pin(int y, int number, const std::string& what) {
    add(text(device_left + 18, y + 4, fmt::format("pin {}, {}: not wired", number, what), "#999"));
}

void Sheet::trigger(int y, const std::string& signal, const TriggerCircuit& circuit) {
    const bool high = circuit.rest == "high";
    board_pin(y, signal);
    wire(board_right, y, device_left, y);
    to_level(230, y, circuit.rest_ohm, high ? "3.3 V" : "ground", high);
    const Driver& driver = *circuits().driver(circuit.driver);
    gate(330, y,
         circuit.gates == 1 ? driver.name
                            : fmt::format("{} gates of {}", circuit.gates, driver.name),
         driver.rail, driver.ties, true);
    resistor(440, y, circuit.series_ohm, false);
}

void Sheet::exposure(int y, const std::string& signal, const ExposureCircuit& circuit) {
    board_pin(y, signal);
    wire(board_right, y, device_left, y);
    if (circuit.divider_ohm.size() == 2) {
        resistor(440, y, circuit.divider_ohm[0], false);
        to_level(330, y, circuit.divider_ohm[1], "ground", false);
    }
    if (!circuit.buffer.empty()) gate(330, y, circuit.buffer, "3.3 V", "", false);
    if (circuit.pull_up_ohm != 0) to_level(440, y, circuit.pull_up_ohm, "3.3 V", true);
}

void Sheet::ground(int y) {
    board_pin(y, "ground");
    wire(board_right, y, device_left, y);
}

void Sheet::imu_wire(int y, const ImuWire& imu, int pull_up_x) {
    constexpr int top = 90;
    wire(board_right, y, device_left, y);
    board_pin(y, imu.board);
    device_pin(y, 0, imu.imu, "", "");
    if (imu.series_ohm != 0) resistor(375, y, imu.series_ohm, false);
    if (imu.pull_up_ohm == 0) return;
    add(dot(pull_up_x, y));
    wire(pull_up_x, y, pull_up_x, top);
    resistor(pull_up_x, top + 30, imu.pull_up_ohm, true);
    wire(pull_up_x - 9, top, pull_up_x + 9, top);
    add(text(pull_up_x, top - 6, named_level("3.3 V"), "#777", "middle"));
}

void Sheet::note(std::string text) {
    while (text.size() > note_columns) {
        const std::size_t blank = text.rfind(' ', note_columns);
        if (blank == std::string::npos) break;
        notes_.push_back(text.substr(0, blank));
        text.erase(0, blank + 1);
    }
    notes_.push_back(std::move(text));
}

std::string Sheet::body() const {
    std::vector<std::string> lines{
        text(board_left, 24, title_, "#000", "start", 15),
        text(board_left, 42, subtitle_, "#555"),
        box(board_left, board_right, 54, bottom_, "#e8f0e8"),
        text((board_left + board_right) / 2, 72, "Pico", "#555", "middle"),
        box(device_left, device_right, 54, bottom_, "#eef2f7"),
        text((device_left + device_right) / 2, 72, device_, "#555", "middle")};
    lines.insert(lines.end(), elements_.begin(), elements_.end());
    for (std::size_t i = 0; i < notes_.size(); ++i)
        lines.push_back(text(board_left, bottom_ + 24 + 18 * static_cast<int>(i), notes_[i]));
    return fmt::format("{}\n", fmt::join(lines, "\n"));
}

Sheet drawing(const WiredCamera& camera) {
    constexpr int trigger_y = 130;
    constexpr int exposure_y = 262;
    constexpr int ground_y = 310;
    const CameraCircuit& circuit = *camera.circuit;
    Sheet sheet(with_name(camera.name, circuit.title),
                fmt::format("Preset \"{}\". {}.", circuit.preset, circuit.connector), "camera");
    TriggerCircuit trigger = circuit.trigger.circuit;
    if (camera.inverted) trigger.rest = "high";
    sheet.trigger(trigger_y, fmt::format("trigger{}", camera.output), trigger);
    sheet.device_pin(trigger_y, circuit.trigger.pin, circuit.trigger.line,
                     figures(circuit.trigger.input), "output");
    if (camera.exposure_line) {
        sheet.exposure(exposure_y, fmt::format("exposure{}", camera.output),
                       circuit.exposure.circuit);
        sheet.device_pin(exposure_y, circuit.exposure.pin, circuit.exposure.line,
                         figures(circuit.exposure.output), "input");
    }
    sheet.ground(ground_y);
    sheet.device_pin(ground_y, circuit.ground_pin, "ground of these lines", "", "supply");
    int y = ground_y;
    for (const UnusedPin& unused : circuit.not_wired)
        sheet.open_pin(y += pin_pitch, unused.pin, unused.what);
    sheet.end_at(y + 24);
    if (!circuit.unknown.empty())
        sheet.note(fmt::format("See the camera's manual for {}.", circuit.unknown));
    if (circuit.configure)
        sheet.note(fmt::format("In the configuration: trigger_line = \"{}\", strobe_line = \"{}\".",
                               circuit.trigger.line, circuit.exposure.line));
    for (const std::string& note : circuit.notes) sheet.note(note);
    if (camera.name.empty()) sheet.note(other_cameras());
    return sheet;
}

Sheet drawing(const WiredImu& imu) {
    const ImuCircuit& circuit = *imu.circuit;
    Sheet sheet(with_name(imu.name, circuit.title),
                fmt::format("Models: {}.", fmt::join(circuit.models, ", ")), "IMU");
    const bool pulled = std::any_of(circuit.wires.begin(), circuit.wires.end(),
                                    [](const ImuWire& wire) { return wire.pull_up_ohm != 0; });
    int y = pulled ? 150 : 100;
    int pull_up_x = 300;
    for (const ImuWire& wire : circuit.wires) {
        sheet.imu_wire(y, wire, pull_up_x);
        pull_up_x += 150;
        y += 34;
    }
    sheet.end_at(y);
    for (const std::string& note : circuit.notes) sheet.note(note);
    sheet.note("Wires shorter than 20 cm. In the configuration: data_ready = true.");
    return sheet;
}

Sheet drawing(const WiredLidar& lidar) {
    constexpr int pulse_y = 130;
    constexpr int serial_y = 270;
    constexpr int ground_y = 350;
    const LidarCircuit& circuit = *lidar.circuit;
    Sheet sheet(with_name(lidar.name, circuit.title),
                fmt::format("Model \"{}\". {}.", circuit.model, circuit.connector), "LiDAR");
    const auto add = [&](int y, const std::string& signal, const TriggerWiring& wiring, bool high) {
        TriggerCircuit resting = wiring.circuit;
        resting.rest = high ? "high" : "low";
        sheet.trigger(y, signal, resting);
        sheet.device_pin(y, wiring.pin, wiring.line, figures(wiring.input), "output");
    };
    add(pulse_y, lidar.output, circuit.pulse, lidar.pulse_inverted);
    if (lidar.sentences) add(serial_y, "uart_transmit", circuit.serial, !lidar.serial_inverted);
    sheet.ground(ground_y);
    sheet.device_pin(ground_y, 0, circuit.ground, "", "supply");
    sheet.end_at(ground_y + 24);
    if (!circuit.unknown.empty())
        sheet.note(fmt::format("See the LiDAR's manual for {}.", circuit.unknown));
    if (std::string shared = shared_line_warning(lidar); !shared.empty())
        sheet.note(std::move(shared));
    for (const std::string& note : circuit.notes) sheet.note(note);
    return sheet;
}

Sheet driven_outputs_drawing() {
    Sheet sheet("Outputs that drive high by themselves", "One or the other.",
                "camera, GNSS receiver, PLC");
    int y = 110;
    for (const DrivenOutput& driven : circuits().driven_outputs) {
        sheet.exposure(y, "exposure0", driven.circuit);
        sheet.device_pin(y, 0, driven.title, figures(driven.output), "input");
        y += 110;
    }
    sheet.ground(y);
    sheet.device_pin(y, 0, "ground", "", "supply");
    sheet.end_at(y + 24);
    sheet.note(
        "These serve every input of the board: pps, aux0, aux1, sync_input, exposure0 to 3.");
    return sheet;
}

Sheet inverted_trigger_drawing() {
    constexpr int y = 170;
    Sheet sheet("A trigger that rests high", "With trigger_inverted = true, for any buffer.",
                "camera");
    TriggerCircuit circuit = circuits().camera("flir-opto")->trigger.circuit;
    circuit.rest = "high";
    sheet.trigger(y, "trigger0", circuit);
    sheet.device_pin(y, 0, "trigger input", "", "output");
    sheet.end_at(y + 64);
    sheet.note("In reset the pad pulls down: 10 k to 3.3 V outweigh that.");
    return sheet;
}

std::vector<Sheet> drawings(const WiredParts& parts) {
    std::vector<Sheet> sheets;
    for (const WiredCamera& camera : parts.cameras)
        if (camera.circuit != nullptr) sheets.push_back(drawing(camera));
    for (const WiredImu& imu : parts.imus)
        if (imu.circuit != nullptr) sheets.push_back(drawing(imu));
    for (const WiredLidar& lidar : parts.lidars)
        if (lidar.circuit != nullptr) sheets.push_back(drawing(lidar));
    return sheets;
}

std::string to_svg(const std::vector<Sheet>& sheets) {
    int y = 0;
    std::string bodies;
    for (const Sheet& sheet : sheets) {
        bodies += fmt::format("<g transform=\"translate(0,{})\">\n{}</g>\n", y, sheet.body());
        y += sheet.height();
    }
    return fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
        width, y, bodies);
}

}  // namespace versavis::client
