// SPDX-License-Identifier: BSD-3-Clause
#include "wiring/wired_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "engine/toml/service_file.hpp"

namespace versavis::client {

namespace {

constexpr auto manual =
    "see the camera's manual; by the kind of its lines, 'versavis wiring flir' (without isolation) "
    "or 'versavis wiring flir-opto' (opto-isolated) shows what they need";

/// Where the configuration names no line, it is the preset's.
bool agrees(const std::string& wanted, const std::string& line, const CameraCircuit& circuit) {
    return wanted.empty() ? !circuit.configure : wanted == line;
}

std::string lines_of(const CameraCircuit& circuit) {
    return fmt::format("{} with {}", circuit.trigger.line, circuit.exposure.line);
}

void choose_circuit(WiredCamera& camera, const std::string& preset, const std::string& trigger_line,
                    const std::string& strobe_line) {
    std::vector<std::string> others;
    std::vector<std::string> fitting;
    for (const CameraCircuit& circuit : circuits().cameras) {
        if (circuit.preset != preset) continue;
        if (agrees(trigger_line, circuit.trigger.line, circuit) &&
            agrees(strobe_line, circuit.exposure.line, circuit)) {
            camera.circuit = &circuit;
            fitting.push_back(
                fmt::format("'versavis wiring {}' ({})", circuit.name, circuit.title));
        }
        others.push_back(lines_of(circuit));
    }
    if (fitting.size() == 1) return;
    camera.circuit = nullptr;
    if (!fitting.empty())
        camera.problem = fmt::format("its model decides: see {}", fmt::join(fitting, " or "));
    else if (preset.empty())
        camera.problem =
            fmt::format("its preset is not known: connect the camera, or set 'preset'; {}", manual);
    else if (others.empty())
        camera.problem = fmt::format("no circuit of preset '{}' is known: {}", preset, manual);
    else
        camera.problem = fmt::format(
            "no circuit for these lines is known, only for {}: set 'trigger_line' and "
            "'strobe_line' so, or see the camera's manual",
            fmt::join(others, ", "));
}

std::string text(const toml::table& table, const char* key, const char* usual = "") {
    return table[key].value_or(std::string(usual));
}

WiredCamera configured_camera(const toml::table& table, const PresetOf& preset_of) {
    WiredCamera camera;
    camera.name = text(table, "name");
    camera.output = table["output"].value_or(0U);
    camera.inverted = table["trigger_inverted"].value_or(false);
    camera.exposure_line = text(table, "strobe") != "none";
    std::string preset = text(table, "preset", "auto");
    if (preset == "auto") preset = preset_of(camera.name, text(table, "device"));
    choose_circuit(camera, preset, text(table, "trigger_line"), text(table, "strobe_line"));
    return camera;
}

WiredImu configured_imu(const toml::table& table) {
    WiredImu imu;
    imu.name = text(table, "name", "imu0");
    imu.data_ready = table["data_ready"].value_or(false);
    const std::string model = text(table, "model", "adis16448b");
    const std::string bus = text(table, "bus", "spi");
    for (const ImuCircuit& circuit : circuits().imus) {
        const auto& models = circuit.models;
        const bool fits = std::find(models.begin(), models.end(), model) != models.end() &&
                          (circuit.bus == bus || circuit.bus == "uart");
        if (fits) imu.circuit = &circuit;
    }
    if (imu.circuit == nullptr)
        imu.problem =
            fmt::format("no circuit of a '{}' on {} is known: check 'model' and 'bus'", model, bus);
    return imu;
}

WiredLidar configured_lidar(const toml::table& table) {
    WiredLidar lidar;
    lidar.name = text(table, "name", "lidar");
    const std::string output = text(table, "output", "sync");
    lidar.output = output == "sync" || output == "test" ? output + "_output" : output;
    lidar.pulse_inverted = table["pulse_inverted"].value_or(false);
    if (const auto* sentences = table["sentences"].as_array())
        lidar.sentences = !sentences->empty();
    const std::string model = text(table, "model", "generic");
    for (const LidarCircuit& circuit : circuits().lidars)
        if (circuit.model == model) lidar.circuit = &circuit;
    if (lidar.circuit == nullptr)
        lidar.problem = fmt::format(
            "no circuit of model '{}' is known: see the manual of what is connected, and "
            "'versavis wiring livox' (3.3 V) or 'versavis wiring velodyne' (5 V) for how the "
            "board drives it",
            model);
    lidar.serial_inverted =
        table["serial_inverted"].value_or(lidar.circuit != nullptr && rests_low(*lidar.circuit));
    return lidar;
}

/// The board has one serial line: outputs without sentences may have those of the one that sends.
void share_sentences(std::vector<WiredLidar>& lidars) {
    const auto sender = std::find_if(lidars.begin(), lidars.end(),
                                     [](const WiredLidar& lidar) { return lidar.sentences; });
    if (sender == lidars.end()) return;
    for (WiredLidar& lidar : lidars) {
        if (lidar.sentences) continue;
        lidar.sentences = true;
        lidar.sentences_of = sender->name;
        lidar.serial_inverted = sender->serial_inverted;
    }
}

template <class Use>
void each_table(const toml::table& file, const char* key, Use use) {
    if (const auto* tables = file[key].as_array())
        for (const auto& item : *tables)
            if (const auto* table = item.as_table()) use(*table);
}

template <class Item>
std::vector<std::string> names_of(const std::vector<Item>& items) {
    std::vector<std::string> names;
    for (const Item& item : items) names.push_back(item.name);
    return names;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

bool rests_low(const LidarCircuit& circuit) { return circuit.serial.circuit.rest == "low"; }

std::string shared_line_warning(const WiredLidar& lidar) {
    if (lidar.sentences_of.empty()) return "";
    std::string text = fmt::format("The sentences are those of {}.", lidar.sentences_of);
    if (lidar.circuit != nullptr && rests_low(*lidar.circuit) != lidar.serial_inverted)
        text += fmt::format(
            " Its line rests {}, and this LiDAR wants the other polarity: put an inverter in "
            "between, such as a 74LVC1G04.",
            lidar.serial_inverted ? "low" : "high");
    return text;
}

Expected<WiredParts> configured_wiring(const std::string& path, const PresetOf& preset_of) {
    const auto file = parse_service_file(path);
    if (!file) return Unexpected<>(file.error().front());
    WiredParts parts;
    each_table(*file, "camera", [&](const toml::table& table) {
        if (text(table, "trigger", "board") == "board")
            parts.cameras.push_back(configured_camera(table, preset_of));
    });
    each_table(*file, "imu",
               [&](const toml::table& table) { parts.imus.push_back(configured_imu(table)); });
    each_table(*file, "time_output",
               [&](const toml::table& table) { parts.lidars.push_back(configured_lidar(table)); });
    share_sentences(parts.lidars);
    std::vector<std::string> outputs;
    for (const WiredCamera& camera : parts.cameras)
        outputs.push_back(fmt::format("trigger{}", camera.output));
    for (const WiredLidar& lidar : parts.lidars) outputs.push_back(lidar.output);
    for (const std::string& output : outputs)
        if (circuits().board.signals.count(output) == 0)
            return failure(path, fmt::format("names {}, which the board does not have", output),
                           "see 'versavisd --check-config'");
    return parts;
}

Expected<WiredParts> named_wiring(const std::vector<std::string>& names) {
    WiredParts parts;
    for (const std::string& name : names) {
        const CameraCircuit* camera = circuits().camera(name);
        const ImuCircuit* imu = circuits().imu(name);
        const LidarCircuit* lidar = circuits().lidar(name);
        if (camera != nullptr) {
            WiredCamera wired;
            wired.circuit = camera;
            parts.cameras.push_back(std::move(wired));
        } else if (imu != nullptr) {
            WiredImu wired;
            wired.circuit = imu;
            parts.imus.push_back(std::move(wired));
        } else if (lidar != nullptr) {
            WiredLidar wired;
            wired.circuit = lidar;
            wired.serial_inverted = rests_low(*lidar);
            parts.lidars.push_back(std::move(wired));
        } else {
            return failure(name, "there is no such circuit", "see 'versavis wiring --list'");
        }
    }
    return parts;
}

Expected<WiredParts> only(WiredParts parts, const std::vector<std::string>& names) {
    std::vector<std::string> known = names_of(parts.cameras);
    for (std::string& imu : names_of(parts.imus)) known.push_back(std::move(imu));
    for (std::string& lidar : names_of(parts.lidars)) known.push_back(std::move(lidar));
    for (const std::string& name : names)
        if (!contains(known, name))
            return failure(name, "is neither a circuit nor a part that the board serves",
                           fmt::format("choose one of {}; circuits: 'versavis wiring --list'",
                                       known.empty() ? "a configuration with parts"
                                                     : fmt::format("{}", fmt::join(known, ", "))));
    const auto unwanted = [&](const auto& part) {
        return !names.empty() && !contains(names, part.name);
    };
    std::erase_if(parts.cameras, unwanted);
    std::erase_if(parts.imus, unwanted);
    std::erase_if(parts.lidars, unwanted);
    return parts;
}

}  // namespace versavis::client
