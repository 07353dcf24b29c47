// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_evaluation.hpp"

#include <catch2/catch.hpp>
#include <memory>

#include "../support/recording_file.hpp"
#include "../support/temporary_directory.hpp"
#include "led_bench.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;

namespace {

/// Frames of a camera that exposes `late` after what its stamps say.
struct LedCamera {
    std::string name;
    std::unique_ptr<LedBench> bench;
    Duration late;
    Duration phase{};  ///< of its stamps
};

constexpr Duration led_exposure = microseconds(1100);

void each_frame(LedCamera& camera, int from, int count,
                const std::function<void(OutputTime, const FrameMetadata&,
                                         const std::vector<std::byte>&)>& take) {
    for (int i = from; i < from + count; ++i) {
        const HostTime middle = HostTime{0} + seconds(1) + camera.phase + milliseconds(100) * i;
        FrameMetadata frame = LedBench::frame(led_exposure);
        frame.trigger = static_cast<std::uint64_t>(i + 1);
        frame.set_tick(static_cast<std::uint64_t>(i));
        const auto pixels =
            camera.bench->pixels(middle + camera.late - led_exposure / 2, led_exposure);
        take(OutputTime{middle.ns}, frame, pixels);
    }
}

Expected<LedReport> evaluate(std::vector<LedCamera>& cameras, int frames,
                             const LedEvaluationSettings& settings,
                             const std::vector<std::string>& required = {}) {
    LedEvaluation evaluation(settings);
    for (LedCamera& camera : cameras)
        each_frame(camera, 0, 40, [&](OutputTime, const auto& frame, const auto& pixels) {
            REQUIRE(evaluation.look(camera.name, frame, pixels));
        });
    if (const auto found = evaluation.find(required); !found) return Unexpected(found.error());
    for (LedCamera& camera : cameras)
        each_frame(camera, 40, frames, [&](OutputTime time, const auto& frame, const auto& pixels) {
            REQUIRE(evaluation.add(camera.name, 1, time, frame, pixels));
        });
    return evaluation.report();
}

LedBenchSettings bench_settings(double rate_hz, std::vector<double> leds) {
    LedBenchSettings settings;
    settings.rate_hz = rate_hz;
    settings.leds = std::move(leds);
    return settings;
}

std::unique_ptr<LedBench> bench(const LedBenchSettings& settings) {
    return std::make_unique<LedBench>(settings);
}

}  // namespace

TEST_CASE("led_evaluation: from pixels to the offset, within 5 us", "[statistics]") {
    const double rate_hz = GENERATE(1000.0, 970.0);
    const Duration late =
        GENERATE(microseconds(-60), microseconds(0), microseconds(23), microseconds(180));
    const Duration phase = GENERATE(microseconds(0), microseconds(500));
    std::vector<LedCamera> cameras;
    cameras.push_back({"cam0", bench(bench_settings(rate_hz, {40, 150, 280, 165})), {}, phase});
    cameras.push_back({"cam1", bench(bench_settings(rate_hz, {240, 60, 70, 30})), late, phase});
    LedEvaluationSettings settings;
    settings.report.rate_hz = rate_hz;
    const auto report = evaluate(cameras, 100, settings);
    REQUIRE(report);
    INFO(to_text(*report));
    CHECK(report->ok());
    CHECK(report->pairs.at(0).matches == 100);
    CHECK(report->pairs.at(0).split == 100);
    CHECK(report->pairs.at(0).offset_us == Approx(static_cast<double>(late.ns) * 1e-3).margin(5));
    CHECK(report->pairs.at(0).interval_us < 5);
}

TEST_CASE("led_evaluation: what lies behind the LEDs does not move the offset", "[statistics]") {
    const double texture = GENERATE(15.0, 40.0);
    const double led_level = GENERATE(160.0, 40.0);
    const Duration late = GENERATE(microseconds(0), microseconds(120));
    auto first = bench_settings(970, {40, 150, 280, 165});
    auto second = bench_settings(970, {240, 60, 70, 30});
    second.texture = texture;
    second.led_level = led_level;
    std::vector<LedCamera> cameras;
    cameras.push_back({"cam0", bench(first), {}});
    cameras.push_back({"cam1", bench(second), late});
    LedEvaluationSettings settings;
    settings.report.rate_hz = 970;
    settings.places = {{"cam0", {40, 150, 280, 165}}, {"cam1", {240, 60, 70, 30}}};
    const auto report = evaluate(cameras, 200, settings);
    CAPTURE(texture, led_level, late.ns);
    REQUIRE(report);
    INFO(to_text(*report));
    const LedPairReport& pair = report->pairs.at(0);
    CHECK(pair.mismatches == 0);
    if (texture >= led_level) {  // nothing is read, and nothing is claimed
        CHECK(pair.matches == 0);
        return;
    }
    CHECK(pair.matches > 150);
    const double error = pair.offset_us - static_cast<double>(late.ns) * 1e-3;
    CHECK(std::abs(error) < 1 + 1.5 * pair.interval_us);
}

TEST_CASE("led_evaluation: a camera without the board is left out, unless it was asked for") {
    std::vector<LedCamera> cameras;
    cameras.push_back({"cam0", bench(bench_settings(970, {40, 150, 280, 165})), {}});
    cameras.push_back({"cam1", bench(bench_settings(970, {-2000, -2000, -1000, -1000})), {}});
    LedEvaluationSettings settings;
    settings.report.rate_hz = 970;
    const auto report = evaluate(cameras, 30, settings);
    REQUIRE(report);
    CHECK(report->cameras.size() == 1);
    CHECK(report->notes.back() == "cam1: left out, no LED board was found");
    std::vector<LedCamera> again;
    again.push_back({"cam0", bench(bench_settings(970, {40, 150, 280, 165})), {}});
    again.push_back({"cam1", bench(bench_settings(970, {-2000, -2000, -1000, -1000})), {}});
    const auto required = evaluate(again, 30, settings, {"cam1"});
    REQUIRE_FALSE(required);
    CHECK_THAT(required.error().message(), Catch::Contains("cam1: no LED board"));
}

TEST_CASE("led_evaluation: a place and an exposure that are given are used, suspects are not") {
    std::vector<LedCamera> cameras;
    cameras.push_back({"cam0", bench(bench_settings(970, {40, 150, 280, 165})), {}});
    LedEvaluationSettings settings;
    settings.report.rate_hz = 970;
    settings.places["cam0"] = {40, 150, 280, 165};
    settings.exposures["cam0"] = led_exposure;
    LedEvaluation evaluation(settings);
    CHECK(evaluation.looked_enough("cam0"));
    REQUIRE(evaluation.find({"cam0"}));
    each_frame(cameras[0], 0, 20, [&](OutputTime time, FrameMetadata frame, const auto& pixels) {
        frame.exposure = {};
        if (frame.tick() < 2) frame.trigger = 0;
        if (frame.tick() == 3) frame.flags |= flag_suspect;
        REQUIRE(evaluation.add("cam0", 1, time, frame, pixels));
        REQUIRE(evaluation.add("cam9", 1, time, frame, pixels));
    });
    const auto report = evaluation.report();
    REQUIRE(report);
    CHECK(report->cameras.at(0).read == 19);
    CHECK(report->cameras.at(0).untriggered == 2);
}

namespace {

/// Both cameras see the board, if there is one; the configuration says how fast it steps.
std::string recorded(const TemporaryDirectory& directory, const std::string& configuration,
                     std::uint32_t pixel_format = 0x01080001) {
    RecordingFile file;
    file.add_attachment("configuration.toml", configuration);
    std::vector<LedCamera> cameras;
    cameras.push_back({"cam0", bench(bench_settings(970, {40, 150, 280, 165})), {}});
    cameras.push_back({"cam1", bench(bench_settings(970, {240, 60, 70, 30})), microseconds(50)});
    for (int i = 0; i < 60; ++i) {
        for (LedCamera& camera : cameras)
            each_frame(camera, i, 1, [&](OutputTime time, FrameMetadata frame, const auto& pixels) {
                frame.pixel_format = pixel_format;
                FileItem item;
                item.stream = camera.name;
                item.kind = ring::StreamKind::frames;
                item.number = static_cast<std::uint64_t>(i);
                item.time = time;
                item.metadata = pack(frame);
                item.payload = pixels;
                file.add(item);
            });
        file.end_chunk();
    }
    return directory.write("leds.mcap", file.finish());
}

}  // namespace

TEST_CASE("led_evaluation: a recording, at the rate that its configuration names") {
    const TemporaryDirectory directory;
    const auto recording = Recording::open(recorded(directory, "[ports]\ntest_rate_hz = 970.0\n"));
    REQUIRE(recording);
    LedEvaluationSettings settings;
    settings.report.rate_hz = recorded_led_rate_hz(*recording);
    CHECK(settings.report.rate_hz == 970);
    std::size_t frames = 0;
    const auto report = evaluate_leds(*recording, {}, settings, [&](std::size_t count) {
        frames = count;
        return true;
    });
    REQUIRE(report);
    INFO(to_text(*report));
    CHECK(report->ok());
    CHECK(report->pairs.at(0).matches == 60);
    CHECK(report->pairs.at(0).offset_us == Approx(50).margin(5));
    CHECK(frames == 120);

    const auto stopped = evaluate_leds(*recording, {"cam0"}, settings,
                                       [&](std::size_t count) { return count < 10; });
    REQUIRE(stopped);
    CHECK(stopped->cameras.at(0).pictures == 10);
    const auto none =
        evaluate_leds(*recording, {"cam7"}, settings, [](std::size_t) { return true; });
    REQUIRE_FALSE(none);
    CHECK_THAT(none.error().message(), Catch::Contains("cam7") && Catch::Contains("cam0, cam1"));
}

TEST_CASE("led_evaluation: recordings that do not say how fast the board steps") {
    for (const auto* configuration : {"", "[ports]\ntest = \"cam0\"\n", "[[[\n",
                                      "[ports]\ntest_rate_hz = \"fast\"\n", "ports = 3\n"}) {
        const TemporaryDirectory directory;
        RecordingFile file;
        file.add_attachment("configuration.toml", configuration);
        const auto recording = Recording::open(directory.write("empty.mcap", file.finish()));
        REQUIRE(recording);
        CHECK(recorded_led_rate_hz(*recording) == 0);
        const auto report = evaluate_leds(*recording, {}, {}, [](std::size_t) { return true; });
        REQUIRE_FALSE(report);
        CHECK_THAT(report.error().message(), Catch::Contains("has no camera"));
    }
}
