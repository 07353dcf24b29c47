// SPDX-License-Identifier: BSD-3-Clause
#include "camera/preset_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

namespace versavis::daemon {

namespace {

/// Of a step: the lowest value that the camera allows.
const std::string lowest_value = "min";

}  // namespace

const char* to_string(StepOutcome outcome) {
    switch (outcome) {
        case StepOutcome::set: return "set";
        case StepOutcome::refused: return "refused";
        case StepOutcome::differs: return "differs";
        case StepOutcome::left_out: return "left_out";
    }
    return "unknown";
}

std::string StepResult::node() const {
    return selector.empty() ? feature : fmt::format("{} of {}", feature, selected);
}

/// The texts with their variables filled in, in the order of preference.
std::vector<PresetRun::Candidate> PresetRun::candidates(
    const std::vector<std::string>& texts) const {
    std::vector<Candidate> all;
    for (const std::string& text : texts) {
        const auto open = text.find('{');
        const auto variable = open == std::string::npos
                                  ? variables_.end()
                                  : variables_.find(text.substr(open + 1, text.size() - open - 2));
        if (variable == variables_.end()) {
            all.push_back({text, variables_});
            continue;
        }
        for (const std::string& value : variable->second) {
            all.push_back({value, variables_});
            all.back().variables[variable->first] = {value};
        }
    }
    return all;
}

/// Tries one value after the other. What already reads so is as good as written: lines of a fixed
/// direction cannot be written at all.
Expected<> PresetRun::write(const std::string& feature, const std::vector<std::string>& texts,
                            std::string& written) {
    const auto offered = camera_.values(feature);
    std::optional<Error> refused;  // of the value that is preferred
    std::vector<std::string> values;
    for (auto& candidate : candidates(texts)) {
        if (candidate.value == lowest_value)
            candidate.value = camera_.lowest(feature).value_or("0");
        values.push_back(candidate.value);
        if (!offered.empty() &&
            std::find(offered.begin(), offered.end(), candidate.value) == offered.end())
            continue;
        written = candidate.value;
        auto done = camera_.set(feature, written);
        if (!done && !same_value(camera_.read(feature), written)) {
            if (!refused) refused = done.error();
            continue;
        }
        variables_ = std::move(candidate.variables);
        return {};
    }
    if (refused) return Unexpected(*refused);
    written = values.empty() ? "" : values.front();
    return failure("feature " + feature,
                   fmt::format("'{}' is not available on this camera", fmt::join(values, "' or '")),
                   fmt::format("available: {}", fmt::join(offered, ", ")));
}

void PresetRun::carry_out(const std::string& group) {
    const auto steps = preset_.groups.find(group);
    if (steps == preset_.groups.end()) return;
    for (const PresetStep& step : steps->second) carry_out(group, step);
}

void PresetRun::carry_out(const std::string& group, const PresetStep& step) {
    StepResult result;
    result.group = group;
    result.needed = step.needed;
    result.feature = fmt::format("{}", fmt::join(step.features, " or "));
    const auto leave_out = [&](const std::string& reason) {
        result.outcome = StepOutcome::left_out;
        result.reason = reason;
        results_.push_back(result);
    };
    // Without the selector there is only one of what it would select.
    if (!step.selector.empty() && camera_.available(step.selector)) {
        result.selector = step.selector;
        if (const auto done = write(step.selector, {step.selected}, result.selected); !done)
            return leave_out(done.error().message());
    }
    const auto feature =
        std::find_if(step.features.begin(), step.features.end(),
                     [&](const std::string& name) { return camera_.available(name); });
    if (feature == step.features.end())
        return leave_out(
            fmt::format("the camera has no {}, or it cannot be used now", result.feature));
    result.feature = *feature;
    const auto done = write(result.feature, step.values, result.wanted);
    if (!done) {
        result.outcome = StepOutcome::refused;
        result.reason = done.error().message();
    }
    results_.push_back(std::move(result));
}

void PresetRun::read_back() {
    for (std::size_t i = 0; i < results_.size(); ++i) {
        StepResult& result = results_[i];
        if (result.outcome != StepOutcome::set && result.outcome != StepOutcome::differs) continue;
        // What a later step set is that step's.
        const bool replaced = std::any_of(results_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                                          results_.end(), [&](const StepResult& later) {
                                              return later.node() == result.node() &&
                                                     later.outcome == StepOutcome::set;
                                          });
        if (replaced) continue;
        if (!result.selector.empty() && !camera_.set(result.selector, result.selected)) continue;
        result.actual = camera_.read(result.feature);
        const bool differs = !result.actual.empty() && !same_value(result.actual, result.wanted);
        result.outcome = differs ? StepOutcome::differs : StepOutcome::set;
        if (differs)
            result.reason =
                fmt::format("reads '{}' after '{}' was written", result.actual, result.wanted);
    }
}

Expected<> PresetRun::verdict() const {
    std::vector<std::string> problems;
    bool by_ptp = false;
    for (const StepResult& result : results_)
        if (result.needed && result.outcome != StepOutcome::set) {
            by_ptp = by_ptp || result.group == "ptp" || result.group == "action";
            problems.push_back(result.outcome == StepOutcome::differs
                                   ? result.node() + " " + result.reason
                                   : result.reason);
        }
    if (problems.empty()) return {};
    return failure(fmt::format("preset {}", preset_.name),
                   fmt::format("does not fit this camera: {}", fmt::join(problems, "; ")),
                   by_ptp ? "trigger it by the board, update its firmware, or set 'preset'"
                          : "set 'trigger_line' and 'strobe_line', another 'preset', or the "
                            "features by name");
}

}  // namespace versavis::daemon
