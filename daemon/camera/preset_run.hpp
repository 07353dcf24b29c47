// SPDX-License-Identifier: BSD-3-Clause
// Carries out the steps of a preset on a camera, and reads back what they set.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "camera/node_map.hpp"
#include "settings/camera_preset.hpp"

namespace versavis::daemon {

enum class StepOutcome {
    set,       ///< reads as it was written
    refused,   ///< the camera refuses it, or offers no such value on this model
    differs,   ///< it was written, and reads otherwise
    left_out,  ///< the camera has no such feature, or it cannot be used now
};
const char* to_string(StepOutcome outcome);

struct StepResult {
    std::string group;
    std::string selector;  ///< empty: nothing was selected
    std::string selected;
    std::string feature;
    std::string wanted;
    std::string actual;  ///< when all was set; empty: it cannot be read, as a command
    StepOutcome outcome = StepOutcome::set;
    std::string reason;  ///< of a refusal, with what the camera offers
    bool needed = false;

    /// "LineSource of Line2", or "TriggerMode".
    std::string node() const;
};

/// What the texts of steps may hold: values by name, the preferred one first. The first that the
/// camera takes is kept for all steps that follow.
using PresetVariables = std::map<std::string, std::vector<std::string>>;

class PresetRun {
 public:
    PresetRun(const CameraPreset& preset, NodeMap& camera, PresetVariables variables)
        : preset_(preset), camera_(camera), variables_(std::move(variables)) {}

    /// Steps of a group that the preset does not have are none.
    void carry_out(const std::string& group);

    /// Reads all that was set, with what was selected for it, and compares.
    void read_back();

    const std::vector<StepResult>& results() const { return results_; }

    /// The value that the camera took for a variable, or the preferred one.
    std::string variable(const std::string& name) const { return variables_.at(name).front(); }

    /// All needed steps that were not done, in one error.
    Expected<> verdict() const;

 private:
    struct Candidate {
        std::string value;
        PresetVariables variables;
    };
    std::vector<Candidate> candidates(const std::vector<std::string>& texts) const;
    Expected<> write(const std::string& feature, const std::vector<std::string>& texts,
                     std::string& written);
    void carry_out(const std::string& group, const PresetStep& step);

    const CameraPreset& preset_;
    NodeMap& camera_;
    PresetVariables variables_;
    std::vector<StepResult> results_;
};

}  // namespace versavis::daemon
