// SPDX-License-Identifier: BSD-3-Clause
#include "stream/camera_pipeline.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr std::uint64_t frame_size = 64 * 48;

CameraConfiguration camera(double rate_hz) {
    CameraConfiguration configuration;
    configuration.name = "cam0";
    configuration.rate_hz = rate_hz;
    configuration.max_exposure_us = 20000;
    return configuration;
}

/// A camera whose triggers and frames the test makes, from `begin` on.
class Bench : public test::Pipelines {
 public:
    explicit Bench(const CameraConfiguration& configuration)
        : pipeline(configuration, 0, translator, events),
          period{static_cast<std::int64_t>(1e9 / configuration.rate_hz)} {
        REQUIRE(pipeline.prepare(directory.path(), frame_size, true));
        exchange(begin);
    }

    /// The board's record of the trigger at grid point `tick`, measured unless flags say otherwise.
    std::optional<clock::Stamp> trigger(std::uint64_t tick,
                                        std::uint16_t flags = wire::exposure_measured) {
        const BoardTime at = to_board(begin + period * static_cast<std::int64_t>(tick));
        wire::Exposure record{};
        record.trigger = ++triggers;
        record.tick = tick;
        record.flags = flags;
        record.trigger_ns = at.ns;
        record.start_ns = (flags & wire::exposure_no_start) != 0 ? wire::no_time : at.ns + 20'000;
        record.end_ns = (flags & wire::exposure_measured) != 0 ? at.ns + 4'020'000 : wire::no_time;
        return pipeline.add(record);
    }

    void frame(std::uint64_t tick) {
        const HostTime at = begin + period * static_cast<std::int64_t>(tick);
        pairing::Arrival arrival;
        arrival.slot = pipeline.acquire().value();
        arrival.block_id = ++frames;
        arrival.camera_time = {at.ns + 777};
        arrival.arrived = at + milliseconds(15);
        arrival.width = 64;
        arrival.height = 48;
        arrival.stride = 64;
        arrival.size = frame_size;
        pipeline.add(arrival);
    }

    const HostTime begin{100'000'000'000};
    CameraPipeline pipeline;
    Duration period;
    std::uint64_t triggers = 0;
    std::uint64_t frames = 0;
};

const std::uint64_t pattern[] = {0, 1, 3, 4, 7, 9, 11};

}  // namespace

TEST_CASE(
    "camera_pipeline: a proved frame carries the measured middle, and all that is known of it") {
    Bench bench(camera(20));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const ring::Item item = reader.next();
    REQUIRE(item.found == ring::Found::item);
    const auto frame = unpack<FrameMetadata>(item.metadata);
    CHECK(frame.stamp_kind() == StampKind::measured_middle);
    CHECK(frame.trigger == 1);
    CHECK(frame.block_id == 1);
    CHECK(frame.exposure == milliseconds(4));
    CHECK(absolute(frame.host_time - (bench.begin + microseconds(2020))) <= nanoseconds(1));
    CHECK(item.time.ns == frame.host_time.ns);
    CHECK(frame.stride == 64);
    CHECK(frame.sigma_ns < 20'000);
    CHECK(bench.pipeline.report().pairing == pairing::State::locked);
    CHECK(bench.pipeline.report().published == std::size(pattern));
}

TEST_CASE(
    "camera_pipeline: an end that was not seen costs no pairing, and sigma reaches to the "
    "arrival") {
    Bench bench(camera(20));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick, tick == 9 ? wire::exposure_no_end : wire::exposure_measured);
        bench.frame(tick);
    }
    std::optional<FrameMetadata> predicted;
    for (auto item = reader.next(); item.found == ring::Found::item; item = reader.next())
        if (unpack<FrameMetadata>(item.metadata).tick == 9)
            predicted = unpack<FrameMetadata>(item.metadata);
    REQUIRE(predicted);
    CHECK(predicted->stamp_kind() == StampKind::predicted_middle);
    CHECK(predicted->exposure.ns == 0);
    CHECK(predicted->sigma_ns >= 8'000'000);
    CHECK(bench.pipeline.report().slips == 0);
    CHECK(bench.pipeline.report().unmeasured == 1);
}

TEST_CASE("camera_pipeline: a frame of a trigger without exposure is withheld") {
    Bench bench(camera(20));
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick, tick == 9 ? wire::exposure_no_start : wire::exposure_measured);
        bench.frame(tick);
    }
    CHECK(bench.pipeline.report().frames_without_trigger == 1);
    CHECK(bench.pipeline.report().published == std::size(pattern) - 1);
}

TEST_CASE(
    "camera_pipeline: an exposure line that shows another exposure than the camera tells proves "
    "nothing") {
    auto configuration = camera(20);
    configuration.on_unproved = GENERATE(OnUnproved::withhold, OnUnproved::flag);
    configuration.check_exposure = GENERATE(true, false);
    Bench bench(configuration);
    auto reader = bench.reader("cam0");
    bench.pipeline.set_camera_exposure(milliseconds(30), bench.begin - seconds(10));
    const bool believed = !configuration.check_exposure;
    const bool flagged = configuration.on_unproved == OnUnproved::flag;
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const auto report = bench.pipeline.report();
    CHECK(report.exposure_contradicted == !believed);
    CHECK(report.published == (believed || flagged ? std::size(pattern) : 0));
    CHECK(report.suspect == (!believed && flagged ? std::size(pattern) : 0));
    if (report.suspect == 0) return;
    const auto frame = unpack<FrameMetadata>(reader.next().metadata);
    CHECK((frame.flags & flag_suspect) != 0);
    CHECK(frame.sigma_ns == sigma_unknown);
    CHECK(frame.trigger == 1);
}

TEST_CASE(
    "camera_pipeline: slow cameras are given the time of their pattern before they are started "
    "again") {
    Bench bench(camera(0.4));
    bench.pipeline.start_requested(pairing::Start::pattern, host_now());
    bench.trigger(4);
    // The pattern's longest gap is three periods of 2.5 s.
    CHECK_FALSE(bench.pipeline.advance(host_now() + milliseconds(7600)));
    CHECK(bench.pipeline.advance(host_now() + seconds(15)));
}

TEST_CASE(
    "camera_pipeline: a camera that runs freely is published as it comes, of unknown accuracy") {
    auto configuration = camera(20);
    configuration.trigger = TriggerSource::free_run;
    Bench bench(configuration);
    auto reader = bench.reader("cam0");
    bench.frame(0);
    const auto frame = unpack<FrameMetadata>(reader.next().metadata);
    CHECK(frame.stamp_kind() == StampKind::arrival);
    CHECK(frame.sigma_ns == sigma_unknown);
    CHECK(frame.trigger == 0);
    CHECK(frame.host_time == frame.arrival);
}

TEST_CASE("camera_pipeline: an exposure is translated once, when its record comes") {
    Bench bench(camera(20));
    auto reader = bench.reader("cam0");
    std::vector<clock::Stamp> stamps;
    for (const std::uint64_t tick : pattern) {
        const auto stamp = bench.trigger(tick);
        REQUIRE(stamp);
        stamps.push_back(*stamp);
        // The estimate moves on before the frame is there.
        bench.exchange(bench.begin + bench.period * static_cast<std::int64_t>(tick));
        bench.frame(tick);
    }
    for (const clock::Stamp& stamp : stamps) {
        const ring::Item item = reader.next();
        REQUIRE(item.found == ring::Found::item);
        CHECK(item.time == stamp.output);
        CHECK(unpack<FrameMetadata>(item.metadata).sigma_ns == stamp.sigma_ns);
    }
}

TEST_CASE("camera_pipeline: of a record that comes twice the first counts") {
    Bench bench(camera(20));
    for (const std::uint64_t tick : pattern) {
        CHECK(bench.trigger(tick));
        --bench.triggers;
        CHECK_FALSE(bench.trigger(tick));
        bench.frame(tick);
    }
    CHECK(bench.pipeline.report().published == std::size(pattern));
    CHECK(bench.pipeline.report().triggers_without_frame == std::size(pattern));
}

TEST_CASE("camera_pipeline: a doubled frame is suspect, with the exposure that it seems to be of") {
    auto configuration = camera(20);
    configuration.on_unproved = OnUnproved::flag;
    Bench bench(configuration);
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    for (std::size_t i = 0; i < std::size(pattern); ++i) reader.next();
    bench.frame(pattern[std::size(pattern) - 1]);
    for (const std::uint64_t tick : {12U, 13U}) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const ring::Item item = reader.next();
    REQUIRE(item.found == ring::Found::item);
    const auto frame = unpack<FrameMetadata>(item.metadata);
    CHECK((frame.flags & flag_suspect) != 0);
    CHECK(frame.trigger == std::size(pattern));
    CHECK(frame.sigma_ns == sigma_unknown);
}

TEST_CASE("camera_pipeline: after a reset, numbers that come again are no repeats") {
    Bench bench(camera(20));
    bench.trigger(0);
    bench.pipeline.reset();
    bench.triggers = 0;
    CHECK(bench.trigger(1));
}

TEST_CASE("camera_pipeline: the middle of an exposure that an opto line shows is the true one") {
    Bench bench(camera(20));
    LineDelays lines;
    lines.line = "Line1";
    lines.start = {microseconds(36), microseconds(9)};
    lines.end = {microseconds(18), microseconds(5)};
    lines.source = DelaySource::preset;
    bench.pipeline.set_line_delays(lines);
    bench.pipeline.set_camera_exposure(microseconds(4018), bench.begin - seconds(10));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    for (std::size_t i = 0; i < std::size(pattern); ++i) {
        const ring::Item item = reader.next();
        REQUIRE(item.found == ring::Found::item);
        const auto frame = unpack<FrameMetadata>(item.metadata);
        const HostTime seen =
            bench.begin + bench.period * static_cast<std::int64_t>(frame.tick) + microseconds(2020);
        CHECK(absolute(frame.host_time - (seen - microseconds(27))) <= microseconds(1));
        CHECK(item.time.ns == frame.host_time.ns);
        CHECK(frame.exposure == microseconds(4018));
        CHECK(frame.delay_ns == 27'000);
        CHECK(frame.sigma_ns >= 7'000);
    }
    const PipelineReport report = bench.pipeline.report();
    CHECK(report.lines.start.delay == microseconds(36));
    CHECK(report.edges.difference == microseconds(-18));
    CHECK(report.edges.frames == std::size(pattern));
    CHECK(report.exposure == microseconds(4018));
}
