// SPDX-License-Identifier: BSD-3-Clause
// How a family of cameras is set up, read from data files (daemon/settings/presets/): one for
// cameras that keep to the standard, and for each maker what differs.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/pairing/evidence.hpp"
#include "line_delays.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

/// Sets the first of the features that the camera has to the first of the values that it takes.
/// A text may be {trigger}, {trigger_line}, {strobe_line}, {edge}, {line_inverter}, {chunk},
/// {chunk_gain}, {max_exposure_us}, {device_key}, {group_key} or {group_mask}; the value "min" is
/// the lowest that the camera allows.
struct PresetStep {
    std::string selector;  ///< is set first, to `selected`, where the camera has it
    std::string selected;
    std::vector<std::string> features;
    std::vector<std::string> values;
    bool needed = false;  ///< else a camera may lack or refuse it
};

enum class LineKind { opto, direct };

/// One line of the camera's connector, and how late each of its edges is; none: nobody knows.
struct PresetLine {
    std::string name;
    LineKind kind = LineKind::opto;
    std::optional<EdgeDelay> input_rising;
    std::optional<EdgeDelay> input_falling;
    std::optional<EdgeDelay> output_rising;
    std::optional<EdgeDelay> output_falling;
};

struct CameraPreset {
    std::string name;
    std::vector<std::string>
        vendors;  ///< parts of the camera's vendor name, in small letters; empty: any
    std::vector<std::string> models;         ///< parts of its model name; empty: any
    std::vector<std::string> triggers;       ///< TriggerSelector: the first that the model has
    std::vector<std::string> trigger_lines;  ///< the same of its lines
    std::vector<std::string> strobe_lines;
    bool line_inverter = false;  ///< makes the exposure line active high
    std::vector<std::string>
        exposure_time;  ///< feature in microseconds: the first that the camera has
    std::vector<std::string> chunk_selector;  ///< of the chunk with the exposure time ...
    std::vector<std::string> chunk_exposure;  ///< ... and the feature that has its value
    double chunk_exposure_unit_us = 1;
    std::vector<std::string> gain;                 ///< feature: the first that reads as a number
    std::vector<std::string> temperature;          ///< the same, in degrees Celsius
    std::vector<std::string> chunk_gain_selector;  ///< of the chunk with the gain ...
    std::vector<std::string> chunk_gain;           ///< ... and the feature that has its value
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< what its stamps are of
    std::vector<PresetLine> lines;
    std::map<std::string, std::vector<PresetStep>>
        groups;  ///< by preset_groups; empty: these cameras have no such thing
};

/// The preset of cameras that keep to the standard. Others take from it what they do not state.
inline const std::string base_preset = "generic";

/// default_settings: as after power-up; known_state: nothing that another program left behind takes
/// part in the timing; trigger: by a line; strobe: the exposure on a line; free_run: without
/// triggers; pulse_width: the trigger's length is the exposure's; chunks: exposure time with each
/// frame; ptp; action: a trigger by scheduled action commands; fixed_exposure: no auto exposure;
/// exposure_limit: the longest that the camera's own auto exposure takes.
extern const std::vector<std::string> preset_groups;

/// Where the presets are that belong to this program.
std::filesystem::path default_preset_directory();

/// That of the configuration, or else of the installation.
std::filesystem::path preset_directory(const Configuration& configuration);

/// All of a directory, most specific first. Errors name file, line and column; none there.
Expected<std::vector<CameraPreset>> load_presets(const std::filesystem::path& directory);

/// The one that is named, or, for "auto", the first that fits the camera. Error: no such preset.
Expected<CameraPreset> choose_preset(const std::vector<CameraPreset>& presets,
                                     const std::string& name, const std::string& vendor,
                                     const std::string& model);

}  // namespace versavis::daemon
