// SPDX-License-Identifier: BSD-3-Clause
#include "wiring/circuits.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "wiring/wiring_table.hpp"

namespace versavis::client {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(CameraInput, kind, high_v, needs_ma, draws_ma,
                                                highest_v)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(CameraOutput, kind, high_v, sinks_ma)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Driver, name, rail, ties)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(TriggerCircuit, driver, series_ohm, rest, rest_ohm,
                                                gates)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(ExposureCircuit, pull_up_ohm, divider_ohm, buffer)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(TriggerWiring, line, pin, input, circuit)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(ExposureWiring, line, pin, output, circuit)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(UnusedPin, pin, what)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(CameraCircuit, name, title, preset, configure,
                                                source, connector, ground_pin, supply_pin, trigger,
                                                exposure, not_wired, notes, unknown)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(ImuWire, imu, board, series_ohm, pull_up_ohm)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(ImuCircuit, name, title, models, bus, source, wires,
                                                notes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(LidarCircuit, name, title, model, source, connector,
                                                ground, pulse, serial, notes, unknown)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(DrivenOutput, title, output, circuit)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BoardPin, gpio, pin)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Rail, pin)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(BoardPins, name, ground_pin, rails, signals)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Circuits, board, drivers, cameras, imus, lidars,
                                                driven_outputs)

namespace {

template <class Item>
const Item* find(const std::vector<Item>& items, const std::string& name) {
    const auto found = std::find_if(items.begin(), items.end(),
                                    [&](const Item& item) { return item.name == name; });
    return found == items.end() ? nullptr : &*found;
}

std::string joined(const std::string& kind, const std::vector<std::string>& parts) {
    return parts.empty() ? kind : fmt::format("{}: {}", kind, fmt::join(parts, ", "));
}

/// Below it no current matters.
constexpr double least_ma = 1;

}  // namespace

const nlohmann::json& circuits_json() {
    static const nlohmann::json table = nlohmann::json::parse(wiring_table);
    return table;
}

const Circuits& circuits() {
    static const auto all = circuits_json().get<Circuits>();
    return all;
}

const Driver* Circuits::driver(const std::string& name) const { return find(drivers, name); }
const CameraCircuit* Circuits::camera(const std::string& name) const { return find(cameras, name); }
const ImuCircuit* Circuits::imu(const std::string& name) const { return find(imus, name); }
const LidarCircuit* Circuits::lidar(const std::string& name) const { return find(lidars, name); }
bool Circuits::has(const std::string& name) const {
    return camera(name) != nullptr || imu(name) != nullptr || lidar(name) != nullptr;
}

std::string ohms(int value) {
    return value >= 1000 ? fmt::format("{:g} k", value / 1000.0) : fmt::format("{} ohm", value);
}

std::string figures(const CameraInput& input) {
    std::vector<std::string> parts;
    if (input.high_v > 0) parts.push_back(fmt::format("above {:g} V", input.high_v));
    if (input.needs_ma >= least_ma)
        parts.push_back(input.draws_ma > input.needs_ma
                            ? fmt::format("{:g} to {:g} mA", input.needs_ma, input.draws_ma)
                            : fmt::format("{:g} mA", input.needs_ma));
    if (input.highest_v > 0) parts.push_back(fmt::format("up to {:g} V", input.highest_v));
    return joined(input.kind + " in", parts);
}

std::string figures(const CameraOutput& output) {
    std::vector<std::string> parts;
    if (output.high_v.size() == 2)
        parts.push_back(fmt::format("{:g} to {:g} V", output.high_v[0], output.high_v[1]));
    if (output.sinks_ma > 0) parts.push_back(fmt::format("{:g} mA at most", output.sinks_ma));
    return joined(output.kind + " out", parts);
}

}  // namespace versavis::client
