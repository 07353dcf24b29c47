// SPDX-License-Identifier: BSD-3-Clause
// How late a camera's trigger input acts and its exposure line shows what it does.
#pragma once

#include <string>
#include <vector>

#include "configuration.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

struct CameraPreset;

struct EdgeDelay {
    Duration delay;
    Duration sigma;  ///< one standard deviation
};

/// Slowest edge of an exposure line: makers and pull-ups stay below, and a figure in nanoseconds
/// that was meant in microseconds does not.
constexpr Duration slowest_edge = milliseconds(1);
constexpr double slowest_edge_us = slowest_edge.ns * 1e-3;

enum class DelaySource { unknown, preset, configuration };
const char* to_string(DelaySource source);

/// From one end of the wire to the other, the board's own parts included.
struct LineDelays {
    std::string line;   ///< the camera's exposure output
    EdgeDelay trigger;  ///< from the board's trigger edge to the start of the exposure
    EdgeDelay start;    ///< from the start of the exposure to the board's stamp of it
    EdgeDelay end;      ///< the same for its end
    DelaySource source = DelaySource::unknown;  ///< of `start` and `end`
};

/// Of the middle of an exposure of which both edges were seen: they pass through the same parts, so
/// that their errors do not average out.
Duration middle_sigma(const LineDelays& lines);

/// What is known without the camera: the configured latency, and the board's own delays.
LineDelays configured_delays(const CameraConfiguration& camera);

/// Of these lines: as configured, else as the preset has them, else unknown with a sigma to match.
LineDelays line_delays(const CameraPreset& preset, const CameraConfiguration& camera,
                       const std::string& trigger_line, const std::string& strobe_line);

/// Gives a camera the latency of its preset's trigger line, as far as that is known before the
/// camera is opened: if its preset is named, and no latency.
void use_named_preset(const std::vector<CameraPreset>& presets, CameraConfiguration& camera);

}  // namespace versavis::daemon
