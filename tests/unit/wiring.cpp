// SPDX-License-Identifier: BSD-3-Clause
#include "check/wiring.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <random>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// A camera as it is truly wired.
struct TrueCamera {
    std::vector<unsigned> outputs;  ///< that trigger it
    std::vector<unsigned> inputs;   ///< that show its exposures
    Duration delay = microseconds(30);
    bool at_end = false;  ///< of the pulse
    bool inverted = false;
    std::optional<Duration> fixed;  ///< length that its line shows
    Duration longer;                ///< than the exposure
    double ignores = 0;             ///< part of the triggers
    double loses = 0;               ///< part of the frames
    unsigned bursts = 1;
    std::size_t idle_frames = 0;
    bool bounces = false;
    bool incomplete = false;  ///< its frames
};

class WiredWorld {
 public:
    explicit WiredWorld(std::vector<TrueCamera> cameras) : cameras_(std::move(cameras)) {}

    std::vector<CameraWiring> check(std::vector<WiredCamera> believed = {
                                        {"a", 0, true, microseconds(30)},
                                        {"b", 1, true, microseconds(30)}}) {
        std::vector<PulseRun> runs;
        PulseRun idle;
        for (const TrueCamera& camera : cameras_) idle.frames.push_back({camera.idle_frames, 0});
        runs.push_back(idle);
        for (const int scale : {1, 2})
            for (unsigned output = 0; output < wire::camera_count; ++output)
                runs.push_back(
                    run(output, microseconds(100) * scale, milliseconds(1) * scale * scale));
        for (const WiredCamera& camera : believed) {
            PulseRun working = run(camera.output, microseconds(100), working_exposure);
            working.working = true;
            runs.push_back(working);
        }
        return judge_wiring(believed, runs);
    }

    Duration working_exposure = milliseconds(8);
    Duration busy_beyond = seconds(1);  ///< exposures longer than this lose every second trigger

 private:
    PulseRun run(unsigned output, Duration width, Duration exposure) {
        PulseRun run;
        run.output = output;
        run.width = width;
        run.exposures.assign(cameras_.size(), exposure);
        run.frames.assign(cameras_.size(), {});
        BoardTime at{1'000'000'000};
        for (unsigned k = 0; k < 32; ++k) {
            run.pulses.push_back(at);
            for (std::size_t i = 0; i < cameras_.size(); ++i) answer(run, i, at, k);
            at = at + milliseconds(50) * (1 + static_cast<std::int64_t>(random_() % 3));
        }
        for (auto& edges : run.inputs)
            std::sort(edges.begin(), edges.end(),
                      [](const LineEdge& a, const LineEdge& b) { return a.at < b.at; });
        return run;
    }

    void answer(PulseRun& run, std::size_t index, BoardTime pulse, unsigned k) {
        const TrueCamera& camera = cameras_[index];
        if (std::count(camera.outputs.begin(), camera.outputs.end(), *run.output) == 0) return;
        const Duration exposure = run.exposures[index];
        if (chance() < camera.ignores || (exposure > busy_beyond && k % 2 == 1)) return;
        if (chance() >= camera.loses) run.frames[index].arrived += camera.bursts;
        if (camera.incomplete) run.frames[index].incomplete = run.frames[index].arrived;
        const Duration jitter{static_cast<std::int64_t>(chance() * 12'000)};
        const BoardTime start =
            pulse + camera.delay + jitter + (camera.at_end ? run.width : Duration{});
        const BoardTime end = start + camera.fixed.value_or(exposure) + camera.longer;
        for (const unsigned input : camera.inputs) {
            run.inputs[input].push_back({start, !camera.inverted});
            if (camera.bounces) {
                run.inputs[input].push_back({start + microseconds(20), camera.inverted});
                run.inputs[input].push_back({start + microseconds(30), !camera.inverted});
            }
            run.inputs[input].push_back({end, camera.inverted});
        }
    }

    double chance() { return std::uniform_real_distribution<double>(0, 1)(random_); }

    std::vector<TrueCamera> cameras_;
    std::mt19937 random_{7};
};

TrueCamera wired(std::vector<unsigned> outputs, std::vector<unsigned> inputs) {
    TrueCamera camera;
    camera.outputs = std::move(outputs);
    camera.inputs = std::move(inputs);
    return camera;
}

TrueCamera right_camera(unsigned port) { return wired({port}, {port}); }

std::vector<std::string> codes(const CameraWiring& camera) {
    std::vector<std::string> codes;
    for (const WiringFinding& finding : camera.findings) codes.push_back(finding.code);
    return codes;
}

using Codes = std::vector<std::string>;

/// What is said of the first camera; the second must be right.
Codes first_code(const TrueCamera& camera) {
    const auto wirings = WiredWorld({camera, right_camera(1)}).check();
    CHECK(codes(wirings[1]) == Codes{"right"});
    CHECK(wirings[0].right == (codes(wirings[0]) == Codes{"right"}));
    return codes(wirings[0]);
}

TrueCamera camera_with(void (*change)(TrueCamera&)) {
    TrueCamera camera = right_camera(0);
    change(camera);
    return camera;
}

}  // namespace

TEST_CASE("wiring: what is right is said to be, with figures") {
    const auto wirings = WiredWorld({right_camera(0), right_camera(1)}).check();
    CHECK(codes(wirings[0]) == Codes{"right"});
    CHECK_THAT(wirings[0].findings[0].text, Catch::Contains("triggered by output 0, 32 of 32"));
}

TEST_CASE("wiring: each fault of one camera is named, and no other") {
    CHECK(first_code(wired({}, {0})) == Codes{"no_trigger"});
    CHECK(first_code(wired({0}, {})) == Codes{"no_exposure_line"});
    CHECK(first_code(wired({2}, {0})) == Codes{"wrong_output"});
    CHECK(first_code(wired({0}, {3})) == Codes{"wrong_input"});
    CHECK(first_code(wired({3}, {3})) == Codes{"wrong_port"});
    CHECK(first_code(wired({3}, {2})) == Codes{"wrong_output", "wrong_input"});
    CHECK(first_code(wired({0, 2}, {0})) == Codes{"two_outputs"});
    CHECK(first_code(wired({0}, {0, 2})) == Codes{"lines_joined"});
    CHECK(first_code(camera_with([](auto& c) { c.at_end = true; })) == Codes{"trigger_edge"});
    CHECK(first_code(camera_with([](auto& c) { c.inverted = true; })) ==
          Codes{"exposure_inverted"});
    CHECK(first_code(camera_with([](auto& c) { c.fixed = milliseconds(2); })) ==
          Codes{"fixed_length"});
    CHECK(first_code(camera_with([](auto& c) { c.longer = microseconds(400); })) ==
          Codes{"slow_edge"});
    CHECK(first_code(camera_with([](auto& c) { c.longer = milliseconds(5); })) == Codes{"readout"});
    CHECK(first_code(camera_with([](auto& c) { c.delay = milliseconds(5); })) ==
          Codes{"late_start"});
    CHECK(first_code(camera_with([](auto& c) { c.ignores = 0.3; })) == Codes{"lost"});
    CHECK(first_code(camera_with([](auto& c) { c.loses = 1; })) == Codes{"no_frames"});
    CHECK(first_code(camera_with([](auto& c) { c.incomplete = true; })) == Codes{"incomplete"});
    CHECK(first_code(camera_with([](auto& c) { c.bursts = 2; })) == Codes{"frames_for_each"});
    CHECK(first_code(camera_with([](auto& c) { c.idle_frames = 20; })) == Codes{"free_run"});
    CHECK(first_code(camera_with([](auto& c) { c.bounces = true; })) == Codes{"bounces"});
}

TEST_CASE("wiring: what shows the trigger pulse is not taken for an exposure") {
    // Its line is as long as the pulse, and no frame comes: it is no sign that it exposes.
    std::vector<PulseRun> runs;
    for (const int scale : {1, 2}) {
        PulseRun run;
        run.output = 0;
        run.width = microseconds(100) * scale;
        run.exposures = {milliseconds(1) * scale * scale};
        run.frames = {{20, 0}};
        for (int k = 0; k < 20; ++k) {
            const BoardTime at{milliseconds(50).ns * (k + k / 3)};
            run.pulses.push_back(at);
            run.inputs[0].push_back({at, true});
            run.inputs[0].push_back({at + run.width, false});
        }
        runs.push_back(run);
    }
    CHECK(codes(judge_wiring({{"a", 0, true, {}}}, runs)[0]) == Codes{"shows_trigger"});
    for (PulseRun& run : runs) run.frames = {{0, 0}};
    CHECK(codes(judge_wiring({{"a", 0, true, {}}}, runs)[0]) == Codes{"no_trigger"});
}

TEST_CASE("wiring: two cameras that are mixed up are reported as swapped") {
    const auto both = [](const TrueCamera& a, const TrueCamera& b) {
        const auto wirings = WiredWorld({a, b}).check();
        CHECK_THAT(wirings[0].findings[0].text, Catch::Contains("swap"));
        CHECK(codes(wirings[0]) == codes(wirings[1]));
        return codes(wirings[0]);
    };
    CHECK(both(wired({1}, {0}), wired({0}, {1})) == Codes{"wrong_output"});
    CHECK(both(wired({0}, {1}), wired({1}, {0})) == Codes{"wrong_input"});
    CHECK(both(wired({1}, {1}), wired({0}, {0})) == Codes{"wrong_port"});
}

TEST_CASE("wiring: a camera on another's output is reported with the output where it belongs") {
    const auto wirings = WiredWorld({right_camera(0), wired({0}, {1})}).check();
    CHECK(codes(wirings[0]) == Codes{"right"});
    CHECK(codes(wirings[1]) == Codes{"shared_trigger"});
    CHECK_THAT(wirings[1].findings[0].text, Catch::Contains("move it to 1"));
}

TEST_CASE("wiring: exposures too long for their rate are found at the configured one") {
    WiredWorld world({right_camera(0), right_camera(1)});
    world.busy_beyond = milliseconds(7);
    CHECK(codes(world.check()[0]) == Codes{"overlap"});
}

TEST_CASE("wiring: so are those that the board waits for") {
    PulseRun run;
    run.output = 0;
    run.pulses.resize(10);
    run.frames = {{10, 0}};
    run.exposures = {milliseconds(60)};
    PulseRun working = run;
    working.working = true;
    working.skipped = 10;
    const auto wirings = judge_wiring({{"a", 0, false, {}}}, {run, working});
    CHECK(codes(wirings[0]) == Codes{"overlap"});
    CHECK_THAT(wirings[0].findings[0].text, Catch::Contains("10 of 20 triggers"));
}

TEST_CASE("wiring: but not where the board takes an inverted line for one exposure") {
    PulseRun run;
    run.output = 0;
    run.width = microseconds(100);
    run.exposures = {milliseconds(1)};
    run.frames = {{10, 0}};
    for (int k = 0; k < 10; ++k) {
        const BoardTime at{milliseconds(50).ns * k};
        run.pulses.push_back(at);
        run.inputs[0].push_back({at, false});
        run.inputs[0].push_back({at + milliseconds(1), true});
    }
    PulseRun second = run;
    second.exposures = {milliseconds(4)};
    for (std::size_t k = 1; k < 20; k += 2)
        second.inputs[0][k].at = second.inputs[0][k - 1].at + milliseconds(4);
    PulseRun working = run;
    working.working = true;
    working.skipped = 10;
    CHECK(codes(judge_wiring({{"a", 0, true, {}}}, {run, second, working})[0]) ==
          Codes{"exposure_inverted"});
}

TEST_CASE("wiring: a camera that exposes for as long as the pulse is right") {
    std::vector<PulseRun> runs;
    for (const int scale : {1, 3}) {
        PulseRun run;
        run.output = 0;
        run.width = run.exposures.emplace_back(microseconds(100) * scale);
        run.frames = {{10, 0}};
        for (int k = 0; k < 10; ++k) {
            const BoardTime at{milliseconds(100).ns * (k + k / 3)};
            run.pulses.push_back(at);
            run.inputs[0].push_back({at + microseconds(20), true});
            run.inputs[0].push_back({at + microseconds(20) + run.width, false});
        }
        runs.push_back(run);
    }
    CHECK(codes(judge_wiring({{"a", 0, true, microseconds(20)}}, runs)[0]) == Codes{"right"});
}

TEST_CASE("wiring: without an exposure line only the trigger is judged") {
    const std::vector<WiredCamera> believed{{"a", 0, false, {}}};
    CHECK(codes(WiredWorld({wired({0}, {})}).check(believed)[0]) == Codes{"right"});
    CHECK(codes(WiredWorld({right_camera(0)}).check(believed)[0]) == Codes{"strobe_unused"});
    CHECK(codes(WiredWorld({wired({1}, {})}).check(believed)[0]) == Codes{"wrong_output"});
    const CameraWiring unseen = WiredWorld({wired({}, {})}).check(believed)[0];
    CHECK(codes(unseen) == Codes{"no_trigger"});
    CHECK_THAT(unseen.findings[0].text, Catch::Contains("no frame arrive"));
}
