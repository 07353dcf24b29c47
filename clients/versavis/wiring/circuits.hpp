// SPDX-License-Identifier: BSD-3-Clause
// The circuits between the board and cameras, IMUs and other devices: hardware/wiring.json, which a
// test holds against data sheets, presets and the firmware's pins.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace versavis::client {

/// What is zero or empty, no source states.
struct PullUp {
    double v = 0;
    int ohm = 0;
};

struct CameraInput {
    std::string kind;  ///< opto or direct
    double high_v = 0;
    double needs_ma = 0;
    double draws_ma = 0;
    double highest_v = 0;
};

struct CameraOutput {
    std::string kind;            ///< opto, direct or push-pull
    std::vector<double> high_v;  ///< lowest and highest
    double sinks_ma = 0;
};

/// A driver of a trigger.
struct Driver {
    std::string name;
    std::string rail;
    std::string ties;  ///< of its other pins; empty: none
};

struct TriggerCircuit {
    std::string driver;
    int series_ohm = 0;
    std::string rest = "low";
    int rest_ohm = 0;  ///< from the board's pin to its level at rest
    int gates = 1;     ///< side by side, which share the current
};

struct ExposureCircuit {
    int pull_up_ohm = 0;           ///< to 3.3 V
    std::vector<int> divider_ohm;  ///< from the camera, and to ground
    std::string buffer;            ///< empty: none
};

struct TriggerWiring {
    std::string line;
    int pin = 0;
    CameraInput input;
    TriggerCircuit circuit;
};

struct ExposureWiring {
    std::string line;
    int pin = 0;
    CameraOutput output;
    ExposureCircuit circuit;
};

struct UnusedPin {
    int pin = 0;
    std::string what;
};

struct CameraCircuit {
    std::string name;
    std::string title;
    std::string preset;
    bool configure = false;  ///< its lines are not the preset's: the configuration names them
    std::string source;
    std::string connector;
    int ground_pin = 0;
    int supply_pin = 0;
    TriggerWiring trigger;
    ExposureWiring exposure;
    std::vector<UnusedPin> not_wired;
    std::vector<std::string> notes;
    std::string unknown;
};

struct ImuWire {
    std::string imu;    ///< the IMU's name of it
    std::string board;  ///< a signal, a rail, or ground
    int series_ohm = 0;
    int pull_up_ohm = 0;
};

struct ImuCircuit {
    std::string name;
    std::string title;
    std::vector<std::string> models;
    std::string bus;
    std::string source;
    std::vector<ImuWire> wires;
    std::vector<std::string> notes;
};

/// Pulses and sentences of a time output, into two inputs.
struct LidarCircuit {
    std::string name;
    std::string title;
    std::string model;  ///< of [[time_output]]
    std::string source;
    std::string connector;
    std::string ground;
    TriggerWiring pulse;
    TriggerWiring serial;
    std::vector<std::string> notes;
    std::string unknown;
};

/// An output that drives its high level by itself.
struct DrivenOutput {
    std::string title;
    CameraOutput output;
    ExposureCircuit circuit;
};

struct BoardPin {
    int gpio = 0;
    int pin = 0;
};

struct Rail {
    int pin = 0;
};

struct BoardPins {
    std::string name;
    int ground_pin = 0;
    std::map<std::string, Rail> rails;
    std::map<std::string, BoardPin> signals;
};

struct Circuits {
    BoardPins board;
    std::vector<Driver> drivers;
    std::vector<CameraCircuit> cameras;
    std::vector<ImuCircuit> imus;
    std::vector<LidarCircuit> lidars;
    std::vector<DrivenOutput> driven_outputs;

    const Driver* driver(const std::string& name) const;
    const CameraCircuit* camera(const std::string& name) const;
    const ImuCircuit* imu(const std::string& name) const;
    const LidarCircuit* lidar(const std::string& name) const;

    /// Of any kind.
    bool has(const std::string& name) const;
};

/// The table itself.
const nlohmann::json& circuits_json();
const Circuits& circuits();

/// "10 k", "100 ohm".
std::string ohms(int value);

/// The kind of a line and its figures, as far as they are known.
std::string figures(const CameraInput& input);
std::string figures(const CameraOutput& output);

}  // namespace versavis::client
