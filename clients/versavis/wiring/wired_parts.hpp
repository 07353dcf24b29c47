// SPDX-License-Identifier: BSD-3-Clause
// The cameras, IMUs and LiDARs of a configuration, each with its circuit.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "wiring/circuits.hpp"

namespace versavis::client {

/// `circuit` is nullptr where none is known; `problem` says why, and what to do.
struct WiredCamera {
    std::string name;
    unsigned output = 0;    ///< of the board, and input of its exposure line
    bool inverted = false;  ///< the trigger rests high
    bool exposure_line = true;
    const CameraCircuit* circuit = nullptr;
    std::string problem;
};

struct WiredImu {
    std::string name;
    bool data_ready = true;
    const ImuCircuit* circuit = nullptr;
    std::string problem;
};

struct WiredLidar {
    std::string name;
    std::string output = "sync_output";  ///< of the board, where the pulses leave
    bool pulse_inverted = false;         ///< they rest high
    bool serial_inverted = false;        ///< the serial line rests low
    bool sentences = true;               ///< there is a serial line
    std::string sentences_of{};          ///< the other output that sends them; empty: its own
    const LidarCircuit* circuit = nullptr;
    std::string problem;
};

/// Whether its line of sentences does, as its maker wants it.
bool rests_low(const LidarCircuit& circuit);

/// What is to be said where another output's sentences serve it; empty: nothing.
std::string shared_line_warning(const WiredLidar& lidar);

struct WiredParts {
    std::vector<WiredCamera> cameras;
    std::vector<WiredImu> imus;
    std::vector<WiredLidar> lidars;

    bool empty() const { return cameras.empty() && imus.empty() && lidars.empty(); }
};

/// The preset of a camera for which the configuration names none; empty: not known.
using PresetOf = std::function<std::string(const std::string& name, const std::string& device)>;

/// Those that the configuration file, which has no errors, triggers by the board. Error: it cannot
/// be read.
Expected<WiredParts> configured_wiring(const std::string& path, const PresetOf& preset_of);

/// Circuits by their own names, at the board's first output. Error: there is no such circuit.
Expected<WiredParts> named_wiring(const std::vector<std::string>& names);

/// Of `parts` those of these names. Error: one is not there.
Expected<WiredParts> only(WiredParts parts, const std::vector<std::string>& names);

}  // namespace versavis::client
