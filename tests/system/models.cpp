// SPDX-License-Identifier: BSD-3-Clause
// Cameras that are built as those of four makers: the service's own presets set them up, whatever
// another program left behind, and each stamp belongs to its frame.
#include <catch2/catch.hpp>
#include <sstream>

#include "../support/judged.hpp"
#include "../support/stack.hpp"
#include "pairing/pair_replay.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

struct Model {
    const char* name;
    const char* preset;
    const char* chunks;    ///< key of the service
    const char* exposure;  ///< feature that sets it
};

const Model models[] = {{"ace", "basler", "chunks = true", "ExposureTimeAbs"},
                        {"blackfly-s", "flir", "", ""},
                        {"hikrobot", "hikrobot", "chunks = true", "ExposureTime"},
                        {"alvium", "alvium", "", "ExposureTime"}};

StackSettings four_models(const std::string& name, unsigned subnet) {
    StackSettings settings{name, subnet, 4, 20, "exposure_us = 4000", "", ""};
    for (const Model& model : models) {
        settings.scenarios.push_back("model = \"" + std::string(model.name) + "\"\n");
        settings.extras.emplace_back(model.chunks);
    }
    settings.scenarios[1] += "exposure_swing = 0.3\n";  // its auto exposure is on by default
    return settings;
}

/// Frames that the pairing needed to see before it proved the first.
unsigned frames_to_lock(const Stack& stack, const std::string& camera) {
    std::string recording;
    REQUIRE(stack.tool({"tail", camera + "-evidence", "--oldest", "-n", "100", "--json"},
                       &recording) == 0);
    std::istringstream lines(recording);
    std::string seen;
    for (std::string line; std::getline(lines, line);) {
        seen += line + "\n";
        std::istringstream so_far(seen);
        const auto replayed = client::replay_pairing(so_far, nullptr);
        if (replayed && replayed->locks > 0) return static_cast<unsigned>(replayed->frames);
    }
    FAIL("the pairing of " << camera << " never locks:\n" << recording);
    return 0;
}

/// All that the presets want is so, and the lengths of exposures have these sources.
void check_setup(const nlohmann::json& status, const std::vector<std::string>& sources) {
    for (std::size_t i = 0; i < std::size(models); ++i) {
        const auto& camera = status["cameras"][i];
        INFO(camera.dump(1));
        CHECK(camera["preset"] == models[i].preset);
        CHECK(camera["exposure_source"] == sources[i]);
        CHECK(camera["setup"].size() >= 15);
        for (const auto& step : camera["setup"]) {
            INFO(step.dump());
            CHECK(step["outcome"] == "set");
        }
    }
}

void judge_all(Stack& stack) {
    const rig::Verdict verdict = judged(stack, 5);
    INFO(rig::to_table(verdict));
    CHECK(verdict.ok);
    for (unsigned i = 0; i < std::size(models); ++i) {
        const auto& stream = verdict.streams.at("cam" + std::to_string(i));
        CHECK(stream.wrong_pairs == 0);
        CHECK(stream.rate_hz == Approx(20).margin(0.5));
    }
}

}  // namespace

TEST_CASE("models: cameras of four makers deliver proved frames as soon as the rig's own") {
    Stack own({"ownmodel", 84, 1, 20, "exposure_us = 4000", "", ""});
    own.start_rig();
    own.start_service();
    own.wait_for_status(healthy);
    const unsigned usual = frames_to_lock(own, "cam0");
    own.service().terminate();
    own.stop_rig();

    StackSettings settings = four_models("models", 85);
    for (unsigned i = 0; i < std::size(models); ++i)
        if (const std::string feature = models[i].exposure; !feature.empty())
            settings.extras[i] += "\n[camera.features]\n" + feature + " = 6000\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    check_setup(status, {"chunk", "chunk", "chunk", "setting"});  // the last has no chunks
    for (unsigned i = 0; i < std::size(models); ++i) {
        INFO(models[i].name);
        if (models[i].exposure[0] != '\0')
            CHECK(status["cameras"][i]["exposure_ns"].get<double>() == Approx(6e6).margin(1e4));
        // Their delays differ, so one may need one frame more; another start takes ten.
        CHECK(frames_to_lock(stack, "cam" + std::to_string(i)) <= usual + 1);
    }
    judge_all(stack);
}

// Without the factory settings each step has to undo by itself what was left behind. Of a camera
// whose frames carry chunks already, nobody need ask for them.
TEST_CASE("models: what another program left behind is undone without loading factory settings") {
    StackSettings settings = four_models("leftover", 86);
    settings.camera_extra = "keep_settings = true";
    settings.scenarios[1] = "model = \"blackfly-s\"\n";
    settings.extras = {};
    settings.faults = "[[fault]]\nkind = \"camera_reboot\"\ncamera = \"cam2\"\nat_exposure = 60\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    // One powers up again, with the same start-up settings.
    const auto status = stack.wait_for_status(
        [](const auto& s) { return s["cameras"][2]["connections"] == 2 && healthy(s); });
    check_setup(status, {"setting", "chunk", "setting", "setting"});
    judge_all(stack);
}

TEST_CASE("models: the probe of each names its preset, and is ready") {
    Stack stack(four_models("probed", 87));
    stack.start_rig();
    for (unsigned i = 0; i < std::size(models); ++i) {
        std::string output;
        CHECK(stack.tool({"camera", "probe", "127.0.87." + std::to_string(i + 2)}, &output) == 0);
        CHECK_THAT(output, Catch::Contains("preset " + std::string(models[i].preset) + "\n") &&
                               Catch::Contains("ready") && !Catch::Contains("not set"));
    }
}

// The presets undo both; whoever sets them by hand learns what is wrong. The last camera's slow
// starts have a trigger in 1.5 s, which is no board without triggers.
TEST_CASE("models: a burst or a pre-delay that is set by hand is named, and nothing else blamed") {
    StackSettings settings{"byhand", 91, 3, 20, "model = \"hikrobot\"", "", ""};
    settings.extras = {"[camera.features]\nStrobeLinePreDelay = 400", "",
                       "[camera.features]\nAcquisitionBurstFrameCount = 3"};
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const auto hint = [](const auto& s, unsigned camera) {
        return s["cameras"][camera]["hint"].template get<std::string>();
    };
    const auto leads = [&](const auto& s) {
        return hint(s, 0).find("rises 0.38 ms before the trigger") != std::string::npos;
    };
    const auto bursts = [&](const auto& s) { return hint(s, 2).find("frames for") < 10; };
    stack.wait_for_status([&](const auto& s) { return leads(s) && bursts(s); });
    stack.wait_for_status([&](const auto& s) {
        INFO(s["cameras"].dump(1));
        CHECK(leads(s));
        CHECK(bursts(s));
        CHECK(s["cameras"][0]["frames_published"] == 0);
        CHECK(s["cameras"][1]["health"] == "ok");
        return s["cameras"][2]["frames_received"] > 250;
    });
}
