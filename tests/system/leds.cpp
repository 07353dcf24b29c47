// SPDX-License-Identifier: BSD-3-Clause
// The published evaluation on the rig: cameras that look at an LED board, which the board's own
// test output drives.
#include <catch2/catch.hpp>
#include <map>

#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "evaluate/led_evaluation.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

constexpr const char* cameras[] = {"cam0", "cam1"};

/// Cameras see the LED board, each in its own way; the world moves behind it.
StackSettings leds_in_view(const std::string& name, unsigned subnet, double rate_hz,
                           const std::string& exposure_us) {
    StackSettings settings{
        name, subnet, 2, 10, "exposure_us = " + exposure_us + "\nnoise = 2\nblur_steps = 1",
        "",   ""};
    settings.faults = "[motion]\nrate_rad_s = [0.3, 0.3, 0.3]\n[leds]\n";
    settings.scenarios = {"leds = [40, 150, 280, 165]", "leds = [240, 60, 70, 30]"};
    settings.camera_extra = "exposure_us = " + exposure_us;
    settings.imu_extra = "[ports]\ntest_rate_hz = " + std::to_string(rate_hz) + "\n";
    return settings;
}

/// Hands frames of both cameras to `take`, until both have had so many.
void each_frame(std::map<std::string, FrameStream>& streams, unsigned frames,
                const std::function<void(const std::string&, const Frame&,
                                         const std::vector<std::byte>&)>& take) {
    std::map<std::string, unsigned> taken;
    const HostTime deadline = host_now() + seconds(90);
    while (taken["cam0"] < frames || taken["cam1"] < frames) {
        if (host_now() > deadline) throw std::runtime_error("too few frames in time");
        for (auto& [name, stream] : streams) {
            const auto item = test::look(stream.next(milliseconds(150)));
            if (item.found != test::Found::item) continue;
            std::vector<std::byte> pixels(item.payload.size());
            if (!item.payload.copy_to(pixels.data())) continue;
            ++taken[name];
            take(name, item, pixels);
        }
    }
}

client::LedReport evaluate(Stack& stack, double rate_hz, unsigned frames) {
    stack.wait_for_status(healthy);
    client::LedEvaluationSettings settings;
    settings.report.rate_hz = rate_hz;
    client::LedEvaluation evaluation(settings);
    std::map<std::string, FrameStream> streams;
    for (const auto* name : cameras)
        streams.emplace(name, wait_for_stream<FrameStream>(name, stack.instance()));
    each_frame(streams, client::LedEvaluation::enough_frames,
               [&](const std::string& camera, const auto& item, const auto& pixels) {
                   REQUIRE(evaluation.look(camera, item.data, pixels));
               });
    const auto found = evaluation.find({"cam0", "cam1"});
    if (!found) throw std::runtime_error(found.error().message());
    each_frame(streams, frames,
               [&](const std::string& camera, const auto& item, const auto& pixels) {
                   REQUIRE(evaluation.add(camera, 1, item.time.output(), item.data, pixels));
               });
    const auto report = evaluation.report();
    if (!report) throw std::runtime_error(report.error().message());
    return *report;
}

}  // namespace

TEST_CASE("leds: as published, 1 kHz and 10 Hz, every pair matches, to parts of a step") {
    Stack stack(leds_in_view("leds", 110, 1000, "1000"));
    stack.start_rig();
    stack.start_service();
    const client::LedReport report = evaluate(stack, 1000, 100);
    INFO(to_text(report));
    CHECK(report.ok());
    CHECK(report.pairs.at(0).matches >= 99);
    CHECK(report.pairs.at(0).offset_us == Approx(0).margin(5));
    CHECK(report.cameras.at(1).binary_first != report.cameras.at(0).binary_first);
}

TEST_CASE("leds: of 400 pairs at 970 Hz all match, and a delayed exposure line is found") {
    StackSettings settings = leds_in_view("ledline", 111, 970, "1100");
    // The service believes that both lines are prompt: the board then exposes cam1 early.
    settings.scenarios[1] += "\nline_rising_us = 90\nline_falling_us = 90";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const client::LedReport report = evaluate(stack, 970, 401);
    INFO(to_text(report));
    CHECK(report.ok());
    const client::LedPairReport& pair = report.pairs.at(0);
    CHECK(pair.matches >= 400);
    CHECK(pair.mismatches == 0);
    CHECK(pair.ambiguous == 0);
    CHECK(pair.split > 300);
    CHECK(pair.offset_us == Approx(-90).margin(5));
    CHECK(pair.interval_us < 5);
}
