// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_preset.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

class Book final : public FeatureBook {
 public:
    explicit Book(std::map<std::string, std::vector<std::string>> features)
        : features_(std::move(features)) {}
    bool has(const std::string& feature) const override { return features_.count(feature) != 0; }
    std::vector<std::string> entries(const std::string& feature) const override {
        const auto found = features_.find(feature);
        return found == features_.end() ? std::vector<std::string>{} : found->second;
    }

 private:
    std::map<std::string, std::vector<std::string>> features_;
};

std::vector<CameraPreset> all() {
    auto presets = load_presets(VERSAVIS_SOURCE_DIR "/daemon/camera/presets");
    REQUIRE(presets);
    return *presets;
}

std::string chosen(const std::string& vendor, const std::string& model) {
    const auto preset = choose_preset(all(), "auto", vendor, model);
    REQUIRE(preset);
    return preset->name;
}

const std::map<std::string, std::string> variables{
    {"trigger_line", "Line0"}, {"strobe_line", "Line1"}, {"edge", "RisingEdge"}};

/// As a camera of the family describes itself, by its maker's feature list.
const Book blackfly_s({{"TriggerSelector", {"AcquisitionStart", "FrameStart", "FrameBurstStart"}},
                       {"TriggerMode", {"Off", "On"}},
                       {"TriggerSource", {"Software", "Line0", "Line1", "Line2", "Line3"}},
                       {"TriggerActivation",
                        {"LevelLow", "LevelHigh", "FallingEdge", "RisingEdge", "AnyEdge"}},
                       {"TriggerOverlap", {"Off", "ReadOut", "PreviousFrame"}},
                       {"TriggerDelay", {}},
                       {"ExposureMode", {"Timed", "TriggerWidth"}},
                       {"AutoExposureExposureTimeUpperLimit", {}},
                       {"AcquisitionFrameRateEnable", {}},
                       {"LineSelector", {"Line0", "Line1", "Line2", "Line3"}},
                       {"LineMode", {"Input", "Output"}},
                       {"LineInverter", {}},
                       {"LineSource", {"Off", "ExposureActive", "FrameTriggerWait"}}});

const Book mako({{"TriggerSelector", {"FrameStart", "AcquisitionStart"}},
                 {"TriggerMode", {"Off", "On"}},
                 {"TriggerSource", {"Freerun", "Line1", "Line2", "FixedRate", "Software"}},
                 {"TriggerActivation", {"RisingEdge", "FallingEdge"}},
                 {"TriggerOverlap", {"Off", "PreviousFrame"}},
                 {"SyncOutSelector", {"SyncOut1", "SyncOut2"}},
                 {"SyncOutSource", {"GPO", "Exposing", "Imaging"}},
                 {"SyncOutPolarity", {"Normal", "Invert"}}});

std::string value_of(const std::vector<PresetAction>& actions, const std::string& feature) {
    std::string value;
    for (const PresetAction& action : actions)
        if (action.feature == feature) value = action.value;
    return value;
}

}  // namespace

TEST_CASE("camera_preset: each family is known by what its cameras call themselves") {
    CHECK(chosen("FLIR", "Blackfly S BFS-PGE-23S3M") == "flir");
    CHECK(chosen("Point Grey Research", "Grasshopper3 GS3-U3-23S6M") == "point-grey");
    CHECK(chosen("Basler", "acA1920-50gm") == "basler");
    CHECK(chosen("Basler", "a2A1920-51gmPRO") == "basler-ace2");
    CHECK(chosen("Basler", "daA1280-54um") == "basler-dart");
    CHECK(chosen("Lucid Vision Labs", "TRI023S-M") == "lucid");
    CHECK(chosen("Allied Vision Technologies", "Mako G-131B") == "allied-vision-gige");
    CHECK(chosen("Allied Vision", "1800 U-158m") == "alvium");
    CHECK(chosen("The Imaging Source Europe GmbH", "DMK 33GX264") == "imaging-source");
    CHECK(chosen("Teledyne DALSA", "Nano-C2420") == "dalsa");
    CHECK(chosen("Somebody", "Else") == "generic");
    CHECK(choose_preset(all(), "lucid", "Basler", "a")->name == "lucid");
    CHECK_THAT(choose_preset(all(), "lucied", "a", "b").error().message(),
               Catch::Contains("one of: auto, "));
}

TEST_CASE("camera_preset: steps become what this camera has") {
    const auto flir = choose_preset(all(), "flir", "", "");
    auto actions = plan(*flir, "trigger", variables, blackfly_s);
    REQUIRE(actions);
    CHECK(actions->back().feature == "TriggerMode");
    CHECK(actions->back().value == "On");
    CHECK(value_of(*actions, "TriggerSource") == "Line0");
    CHECK(value_of(*actions, "TriggerOverlap") == "ReadOut");
    CHECK(value_of(*actions, "TriggerSelector") == "FrameStart");
    CHECK(value_of(*actions, "AcquisitionFrameRateEnable") == "false");
    CHECK(value_of(*plan(*flir, "strobe", variables, blackfly_s), "LineSource") ==
          "ExposureActive");
    CHECK(value_of(*plan(*flir, "exposure_limit", {{"max_exposure_us", "45000"}}, blackfly_s),
                   "AutoExposureExposureTimeUpperLimit") == "45000");
    CHECK(value_of(*plan(*flir, "pulse_width", variables, blackfly_s), "ExposureMode") ==
          "TriggerWidth");

    const auto allied = choose_preset(all(), "allied-vision-gige", "", "");
    const std::map<std::string, std::string> lines{
        {"trigger_line", "Line1"}, {"strobe_line", "SyncOut1"}, {"edge", "RisingEdge"}};
    CHECK(plan(*allied, "trigger", lines, mako));
    CHECK(value_of(*plan(*allied, "strobe", lines, mako), "SyncOutSource") == "Exposing");
}

TEST_CASE("camera_preset: all that a camera lacks is said at once") {
    const auto flir = choose_preset(all(), "flir", "", "");
    const auto actions = plan(*flir, "strobe", variables, mako);
    REQUIRE_FALSE(actions);
    CHECK_THAT(actions.error().message(), Catch::Contains("no LineSelector") &&
                                              Catch::Contains("no LineSource") &&
                                              Catch::Contains("preset"));
    const std::map<std::string, std::string> wrong{
        {"trigger_line", "Line7"}, {"strobe_line", "Line1"}, {"edge", "RisingEdge"}};
    CHECK_THAT(plan(*flir, "trigger", wrong, blackfly_s).error().message(),
               Catch::Contains("TriggerSource knows only Software, Line0"));
}

TEST_CASE("camera_preset: errors of preset files name line and key") {
    test::TemporaryDirectory directory;
    CHECK_THAT(load_presets(directory.path()).error().message(),
               Catch::Contains("no camera presets"));
    directory.write(
        "bad.toml",
        "vendors = [\"a\"]\n[[trigger]]\nset = [\"A\"]\nto = [\"B\"]\noptinal = true\n");
    const std::string message = load_presets(directory.path()).error().message();
    CHECK_THAT(message, Catch::Contains("bad.toml") && Catch::Contains("optional"));
    directory.write("bad.toml", "[[trigger]]\nset = [\"A\"]\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("'set' and 'to'"));
}

TEST_CASE("camera_preset: lines are direct where the camera has such, and have their delays") {
    for (const char* name : {"flir", "basler-usb", "basler"}) {
        INFO(name);
        const auto preset = choose_preset(all(), name, "", "");
        REQUIRE(preset);
        const auto strobe =
            std::find_if(preset->lines.begin(), preset->lines.end(),
                         [&](const PresetLine& line) { return line.name == preset->strobe_line; });
        REQUIRE(strobe != preset->lines.end());
        CHECK((strobe->kind == LineKind::direct) == (std::string(name) != "basler"));
        REQUIRE((strobe->output_rising && strobe->output_falling));
        CHECK(strobe->output_rising->sigma.ns > 0);
    }
    CHECK(chosen("Basler", "acA1920-155um") == "basler-usb");
    CHECK(chosen("Basler", "a2A1920-160umPRO") == "basler-ace2");
}

TEST_CASE("camera_preset: a line that does not add up is refused, with its place") {
    test::TemporaryDirectory directory;
    const auto error = [&](const std::string& keys) {
        directory.write("bad.toml", "[[line]]\nname = \"Line1\"\nkind = \"opto\"\n" + keys);
        const auto loaded = load_presets(directory.path());
        return loaded ? std::string("no error") : loaded.error().message();
    };
    CHECK(error("output_rising_us = [36.0, 9]\n") == "no error");
    for (const char* keys :
         {"output_rising_us = [36]\n", "output_rising_us = 36\n", "output_rising_us = [36, -1]\n",
          "output_rising_us = [\"a\", 1]\n", "output_rising_us = [36000, 1]\n"})
        CHECK_THAT(error(keys), Catch::Contains("bad.toml:4:") && Catch::Contains("2 numbers"));
    CHECK_THAT(error("output_raising_us = [1, 1]\n"), Catch::Contains("output_rising_us"));
    directory.write("bad.toml", "[[line]]\nkind = \"direct\"\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("'name'"));
    directory.write("bad.toml", "[[line]]\nname = \"Line1\"\nkind = \"opt\"\n");
    CHECK_THAT(load_presets(directory.path()).error().message(), Catch::Contains("opto, direct"));
}

TEST_CASE("camera_preset: a family may be known by what its cameras stamp") {
    test::TemporaryDirectory directory;
    directory.write("known.toml", "stamp_instant = \"end\"\n");
    directory.write("other.toml", "vendors = [\"else\"]\n");
    const auto presets = load_presets(directory.path());
    REQUIRE(presets);
    CHECK(choose_preset(*presets, "known", "", "")->stamp_instant == pairing::Instant::end);
    CHECK(choose_preset(*presets, "other", "", "")->stamp_instant == pairing::Instant::unknown);
    directory.write("known.toml", "stamp_instant = \"dawn\"\n");
    CHECK_FALSE(load_presets(directory.path()));
}
