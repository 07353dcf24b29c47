// SPDX-License-Identifier: BSD-3-Clause
#include "camera/preset_run.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// Features with their values: of a number, `offered` is empty. LineMode and LineSource are kept
/// for each line.
class PresetCamera final : public NodeMap {
 public:
    struct Feature {
        std::string value;
        std::vector<std::string> offered;
        bool fixed = false;
    };
    std::map<std::string, Feature> features{
        {"LineSelector", {"Line0", {"Line0", "Line2"}}},
        {"LineMode of Line0", {"Input", {"Input", "Output"}, true}},
        {"LineMode of Line2", {"Input", {"Input", "Output"}}},
        {"LineSource of Line2", {"Off", {"Off", "ExposureActive"}}},
        {"StrobeDelay", {"100", {}}},
        {"TriggerMode", {"Off", {"Off", "On"}}}};
    std::string ignores;  ///< takes what is written to it, and keeps its value

    bool available(const std::string& feature) const override { return find(feature) != nullptr; }
    std::vector<std::string> values(const std::string& feature) const override {
        return find(feature) != nullptr ? find(feature)->offered : std::vector<std::string>{};
    }
    std::optional<std::string> lowest(const std::string&) const override { return "8"; }
    Expected<> set(const std::string& name, const std::string& value) override {
        Feature* feature = find(name);
        if (feature == nullptr || feature->fixed) return failure("feature " + name, "is refused");
        if (name != ignores) feature->value = value;
        return {};
    }
    std::string read(const std::string& feature) const override {
        return find(feature) != nullptr ? find(feature)->value : "";
    }

 private:
    Feature* find(const std::string& name) {
        const auto selected = features.find(name + " of " + features["LineSelector"].value);
        const auto found = selected != features.end() ? selected : features.find(name);
        return found == features.end() ? nullptr : &found->second;
    }
    const Feature* find(const std::string& name) const {
        return const_cast<PresetCamera*>(this)->find(name);
    }
};

PresetStep step(const std::string& feature, std::vector<std::string> values, bool needed = false) {
    return {"LineSelector", "{line}", {feature}, std::move(values), needed};
}

struct PresetBench {
    CameraPreset preset;
    PresetCamera camera;
    PresetVariables variables{{"line", {"Out1", "Line2"}}};

    PresetRun run(std::vector<PresetStep> steps) {
        preset.name = "test";
        preset.groups["strobe"] = std::move(steps);
        PresetRun run(preset, camera, variables);
        run.carry_out("strobe");
        run.read_back();
        return run;
    }
};

}  // namespace

TEST_CASE("preset_run: of lines and values the first is taken that this model offers") {
    PresetBench bench;
    const auto run = bench.run({step("LineMode", {"Strobe", "Output"}, true),
                                step("LineSource", {"ExposureActive"}, true),
                                step("StrobeDelay", {"0"}), step("TriggerDelay", {"min"})});
    CHECK(run.verdict());
    CHECK(run.variable("line") == "Line2");
    CHECK(bench.camera.features["LineMode of Line2"].value == "Output");
    CHECK(run.results()[0].node() == "LineMode of Line2");
    CHECK(run.results()[1].actual == "ExposureActive");
    CHECK(bench.camera.features["StrobeDelay"].value == "0");
    CHECK(run.results()[3].outcome == StepOutcome::left_out);
}

TEST_CASE("preset_run: without the selected line nothing is written to another one") {
    PresetBench bench;
    bench.variables = {{"line", {"Line7"}}};
    const auto run = bench.run({step("LineMode", {"Output"}), step("LineSource", {"Off"}, true)});
    CHECK(run.results()[0].outcome == StepOutcome::left_out);
    CHECK_THAT(run.verdict().error().message(),
               Catch::Contains("'Line7' is not available") && Catch::Contains("Line0, Line2"));
    CHECK(bench.camera.features["LineMode of Line2"].value == "Input");
}

TEST_CASE("preset_run: a value that stands already may be refused") {
    PresetBench bench;
    bench.variables = {{"line", {"Line0"}}};
    const auto run = bench.run({step("LineMode", {"Input"}, true)});
    CHECK(run.verdict());
    const auto other = bench.run({step("LineMode", {"Output"}, true)});
    CHECK(other.results()[0].outcome == StepOutcome::refused);
    CHECK_THAT(other.verdict().error().message(), Catch::Contains("LineMode: is refused"));
    CHECK(bench.run({step("LineMode", {"Output"})}).verdict());  // it is not needed
}

TEST_CASE("preset_run: what reads otherwise than it was written is found") {
    PresetBench bench;
    bench.camera.ignores = "LineSource";
    const auto run = bench.run({step("LineSource", {"ExposureActive"}, true)});
    CHECK(run.results()[0].outcome == StepOutcome::differs);
    CHECK_THAT(run.verdict().error().message(),
               Catch::Contains("LineSource of Line2 reads 'Off' after 'ExposureActive'"));
}

TEST_CASE("preset_run: the lowest value is what the camera says it is") {
    PresetBench bench;
    CHECK(bench.run({step("StrobeDelay", {"min"})}).results()[0].wanted == "8");
}

TEST_CASE("preset_run: values are the same when they are the same number") {
    CHECK(same_value("50000", "5e4"));
    CHECK(same_value("0.1", "0.10000000149011612"));
    CHECK_FALSE(same_value("1", "1.001"));
    CHECK_FALSE(same_value("Line1", "Line2"));
    CHECK_FALSE(same_value("1", ""));
}
