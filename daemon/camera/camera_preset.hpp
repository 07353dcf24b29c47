// SPDX-License-Identifier: BSD-3-Clause
// How a family of cameras is set up, read from data files (daemon/camera/presets/), and checked
// before it is used.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "camera/line_delays.hpp"
#include "engine/pairing/evidence.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

/// Sets the first of the features that the camera has to the first of the values that it knows.
struct PresetStep {
    std::vector<std::string> features;
    std::vector<std::string>
        values;             ///< may hold {trigger_line}, {strobe_line}, {edge}, {max_exposure_us}
    bool optional = false;  ///< a camera may lack or refuse it
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
    std::vector<std::string> models;  ///< parts of its model name; empty: any
    std::string trigger_line;
    std::string strobe_line;
    std::vector<std::string>
        exposure_time;  ///< feature in microseconds: the first that the camera has
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< what its stamps are of
    std::vector<PresetLine> lines;
    std::map<std::string, std::vector<PresetStep>> groups;  ///< by preset_groups
};

/// trigger: by a line; strobe: the exposure on a line; free_run: without triggers; pulse_width: the
/// trigger's length is the exposure's; chunks: exposure time with each frame; ptp; fixed_exposure:
/// no auto exposure; exposure_limit: the longest that the camera's own auto exposure takes.
extern const std::vector<std::string> preset_groups;

/// Where the presets are that belong to this program.
std::filesystem::path default_preset_directory();

/// All of a directory, most specific first. Errors name file, line and column; none there.
Expected<std::vector<CameraPreset>> load_presets(const std::filesystem::path& directory);

/// The one that is named, or, for "auto", the first that fits the camera. Error: no such preset.
Expected<CameraPreset> choose_preset(const std::vector<CameraPreset>& presets,
                                     const std::string& name, const std::string& vendor,
                                     const std::string& model);

/// What a camera's description says of a feature.
class FeatureBook {
 public:
    virtual ~FeatureBook() = default;
    virtual bool has(const std::string& feature) const = 0;
    /// Values of an enumeration; empty for other features.
    virtual std::vector<std::string> entries(const std::string& feature) const = 0;
};

struct PresetAction {
    std::string feature;
    std::string value;
    bool optional = false;
};

/// The steps of a group as actions for this camera. Error: all that the camera lacks, with what it
/// has.
Expected<std::vector<PresetAction>> plan(const CameraPreset& preset, const std::string& group,
                                         const std::map<std::string, std::string>& variables,
                                         const FeatureBook& camera);

}  // namespace versavis::daemon
