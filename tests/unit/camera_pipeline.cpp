// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/camera_pipeline.hpp"
#include "../support/look.hpp"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <functional>
#include <random>
#include <thread>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr std::uint64_t frame_size = 64 * 48;

CameraConfiguration camera_at_rate(double rate_hz) {
    CameraConfiguration configuration;
    configuration.name = "cam0";
    configuration.rate_hz = rate_hz;
    configuration.max_exposure_us = 20000;
    return configuration;
}

/// A camera whose triggers and frames the test makes, from `begin` on.
class PipelineBench : public test::Pipelines {
 public:
    explicit PipelineBench(const CameraConfiguration& configuration)
        : pipeline(configuration, 0, translator, events),
          period{static_cast<std::int64_t>(1e9 / configuration.rate_hz)} {
        synchronise(begin);
        pipeline.set_camera_exposure(milliseconds(4), {});
    }

    /// The board's record of the trigger at grid point `tick`, measured unless flags say otherwise.
    std::optional<clock::Stamp> trigger(std::uint64_t tick,
                                        std::uint16_t flags = wire::exposure_measured) {
        const BoardTime at = to_board(begin + period * static_cast<std::int64_t>(tick));
        wire::Exposure record{};
        record.trigger = ++triggers;
        record.tick = tick;
        // Grid points are left out in the pattern alone.
        record.flags = static_cast<std::uint16_t>(flags | (tick < 20 ? wire::exposure_pattern : 0));
        record.trigger_ns = at.ns;
        record.start_ns = (flags & wire::exposure_no_start) != 0 ? wire::no_time : at.ns + 20'000;
        record.end_ns = (flags & wire::exposure_measured) != 0 ? at.ns + 4'020'000 : wire::no_time;
        return send(record);
    }

    /// It comes when the exposure is over; `lie` may damage it on its way.
    std::optional<clock::Stamp> send(wire::Exposure record) {
        const HostTime received =
            begin + period * static_cast<std::int64_t>(record.tick) + milliseconds(6);
        lie(record);
        return pipeline.add(record, received);
    }

    void frame(std::uint64_t tick) {
        const HostTime at = begin + period * static_cast<std::int64_t>(tick);
        pairing::Arrival arrival;
        arrival.slot = pipeline.acquire().value();
        arrival.block_id = ++frames;
        arrival.camera_time = {at.ns + 777};
        arrival.arrived = at + milliseconds(15);
        arrival.exposure = chunk;
        arrival.width = 64;
        arrival.height = 48;
        arrival.stride = 64;
        arrival.size = frame_size;
        pipeline.add(arrival);
    }

    void pass(std::uint64_t tick) {
        trigger(tick);
        frame(tick);
        for (auto item = test::look(reader_.next()); item.found == test::Found::item;
             item = test::look(reader_.next()))
            published.push_back(unpack<FrameMetadata>(item.metadata));
    }
    void run(std::uint64_t from, std::uint64_t to) {
        for (std::uint64_t tick = from; tick < to; ++tick) pass(tick);
    }
    void start() {
        for (const std::uint64_t tick : {0U, 1U, 3U, 4U, 7U, 9U, 11U}) pass(tick);
    }

    const HostTime begin{100'000'000'000};
    std::function<void(wire::Exposure&)> lie = [](wire::Exposure&) {};
    Duration chunk;  ///< of the frames to come; 0: they have none
    CameraPipeline pipeline;
    Duration period;
    std::uint64_t triggers = 0;
    std::uint64_t frames = 0;
    std::vector<FrameMetadata> published;  ///< by pass()

 private:
    ring::Reader prepared() {
        REQUIRE(pipeline.prepare(directory.path(), frame_size, true));
        return reader("cam0");
    }

    ring::Reader reader_ = prepared();
};

const std::uint64_t pattern_ticks[] = {0, 1, 3, 4, 7, 9, 11};

}  // namespace

TEST_CASE(
    "camera_pipeline: a proved frame carries the measured middle, and all that is known of it") {
    PipelineBench bench(camera_at_rate(20));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    const auto frame = unpack<FrameMetadata>(item.metadata);
    CHECK(frame.stamp_kind() == StampKind::measured_middle);
    CHECK(frame.trigger == 1);
    CHECK(frame.block_id == 1);
    CHECK(frame.exposure == milliseconds(4));
    CHECK(absolute(frame.host_time - (bench.begin + microseconds(2020))) <= microseconds(1));
    CHECK(item.time.ns == frame.host_time.ns);
    CHECK(frame.stride == 64);
    CHECK(frame.sigma_ns < 20'000);
    CHECK(bench.pipeline.report().pairing == pairing::State::locked);
    CHECK(bench.pipeline.report().published == std::size(pattern_ticks));
}

TEST_CASE(
    "camera_pipeline: an end that was not seen costs no pairing, and sigma reaches to the "
    "arrival") {
    PipelineBench bench(camera_at_rate(20));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick, tick == 9 ? wire::exposure_no_end : wire::exposure_measured);
        bench.frame(tick);
    }
    std::optional<FrameMetadata> predicted;
    for (auto item = test::look(reader.next()); item.found == test::Found::item;
         item = test::look(reader.next()))
        if (unpack<FrameMetadata>(item.metadata).tick() == 9)
            predicted = unpack<FrameMetadata>(item.metadata);
    REQUIRE(predicted);
    CHECK(predicted->stamp_kind() == StampKind::predicted_middle);
    CHECK(predicted->exposure.ns == 0);
    CHECK(predicted->sigma_ns >= 8'000'000);
    CHECK(bench.pipeline.report().slips == 0);
    CHECK(bench.pipeline.report().unmeasured == 1);
}

TEST_CASE("camera_pipeline: a frame of a trigger without exposure is withheld") {
    PipelineBench bench(camera_at_rate(20));
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick, tick == 9 ? wire::exposure_no_start : wire::exposure_measured);
        bench.frame(tick);
    }
    CHECK(bench.pipeline.report().frames_without_trigger == 1);
    CHECK(bench.pipeline.report().published == std::size(pattern_ticks) - 1);
}

TEST_CASE(
    "camera_pipeline: an exposure line that shows another exposure than the camera reports proves "
    "nothing") {
    auto configuration = camera_at_rate(20);
    configuration.on_unproved = GENERATE(OnUnproved::withhold, OnUnproved::flag);
    configuration.check_exposure = GENERATE(true, false);
    PipelineBench bench(configuration);
    auto reader = bench.reader("cam0");
    bench.pipeline.set_camera_exposure(milliseconds(30), bench.begin - seconds(10));
    const bool believed = !configuration.check_exposure;
    const bool flagged = configuration.on_unproved == OnUnproved::flag;
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const auto report = bench.pipeline.report();
    CHECK(report.exposure_contradicted == !believed);
    CHECK(report.published == (believed || flagged ? std::size(pattern_ticks) : 0));
    CHECK(report.suspect == (!believed && flagged ? std::size(pattern_ticks) : 0));
    CHECK(report.triggers_without_frame == (believed ? 0 : std::size(pattern_ticks)));
    auto events = bench.reader("events");
    std::size_t announced = 0;
    for (auto item = test::look(events.next()); item.found == test::Found::item;
         item = test::look(events.next())) {
        const auto event = unpack<EventMetadata>(item.metadata);
        if (event.kind == EventKind::trigger_without_frame) {
            CHECK(event.reason == EventReason::wrong_exposure);
            CHECK(event.value == static_cast<std::int64_t>(++announced));
        }
    }
    CHECK(announced == report.triggers_without_frame);
    if (report.suspect == 0) return;
    const auto frame = unpack<FrameMetadata>(test::look(reader.next()).metadata);
    CHECK((frame.flags & flag_suspect) != 0);
    CHECK(frame.sigma_ns == sigma_unknown);
    CHECK(frame.trigger == 1);
}

TEST_CASE(
    "camera_pipeline: slow cameras are given the time of their pattern before they are started "
    "again") {
    PipelineBench bench(camera_at_rate(0.4));
    bench.pipeline.start_requested(pairing::Start::pattern, bench.begin);
    bench.trigger(4);
    const HostTime then = bench.begin + bench.period * 4;
    // The pattern's longest gap is three periods of 2.5 s.
    CHECK_FALSE(bench.pipeline.advance(then + milliseconds(7600)));
    CHECK(bench.pipeline.advance(then + seconds(15)));
}

TEST_CASE(
    "camera_pipeline: a camera that runs freely is published as it comes, of unknown accuracy") {
    auto configuration = camera_at_rate(20);
    configuration.trigger = TriggerSource::free_run;
    PipelineBench bench(configuration);
    auto reader = bench.reader("cam0");
    bench.frame(0);
    const auto frame = unpack<FrameMetadata>(test::look(reader.next()).metadata);
    CHECK(frame.stamp_kind() == StampKind::arrival);
    CHECK(frame.sigma_ns == sigma_unknown);
    CHECK(frame.trigger == 0);
    CHECK(frame.host_time == frame.arrival);
}

TEST_CASE("camera_pipeline: an exposure is translated once, when its record comes") {
    PipelineBench bench(camera_at_rate(20));
    auto reader = bench.reader("cam0");
    std::vector<clock::Stamp> stamps;
    for (const std::uint64_t tick : pattern_ticks) {
        const auto stamp = bench.trigger(tick);
        REQUIRE(stamp);
        stamps.push_back(*stamp);
        // The estimate moves on before the frame is there.
        bench.exchange(bench.begin + bench.period * static_cast<std::int64_t>(tick));
        bench.frame(tick);
    }
    for (const clock::Stamp& stamp : stamps) {
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        CHECK(item.time.output() == stamp.output);
        CHECK(unpack<FrameMetadata>(item.metadata).sigma_ns >= stamp.sigma_ns);
        CHECK(unpack<FrameMetadata>(item.metadata).sigma_ns < stamp.sigma_ns + 8'000);
    }
}

TEST_CASE("camera_pipeline: of a record that comes twice the first counts") {
    PipelineBench bench(camera_at_rate(20));
    for (const std::uint64_t tick : pattern_ticks) {
        CHECK(bench.trigger(tick));
        --bench.triggers;
        CHECK_FALSE(bench.trigger(tick));
        bench.frame(tick);
    }
    CHECK(bench.pipeline.report().published == std::size(pattern_ticks));
    CHECK(bench.pipeline.report().records_doubted == std::size(pattern_ticks));
}

TEST_CASE("camera_pipeline: what a first record that lied may have misled begins anew") {
    PipelineBench bench(camera_at_rate(20));
    bench.lie = [](wire::Exposure& record) { record.trigger += 5; };
    CHECK(bench.trigger(0));
    bench.lie = [](wire::Exposure&) {};
    CHECK(bench.pipeline.report().triggers_without_frame == 0);
    CHECK(bench.trigger(1));
    CHECK(bench.pipeline.report().records_doubted == 0);
    CHECK(bench.pipeline.report().triggers_without_frame == 1);
}

TEST_CASE("camera_pipeline: of two records of a trigger that differ neither is believed") {
    PipelineBench bench(camera_at_rate(20));
    bench.start();
    bench.trigger(12);
    --bench.triggers;
    bench.lie = [](wire::Exposure& record) { record.start_ns += 1000; };
    CHECK_FALSE(bench.trigger(12));
    bench.lie = [](wire::Exposure&) {};
    bench.frame(12);
    bench.run(13, 16);
    CHECK(bench.pipeline.report().published == std::size(pattern_ticks) + 3);
    CHECK(bench.pipeline.report().slips == 0);
}

namespace {

void shift(wire::Exposure& record, Duration by) {
    record.trigger_ns += by.ns;
    record.start_ns += by.ns;
    record.end_ns += by.ns;
}

const std::vector<std::pair<std::string, std::function<void(wire::Exposure&)>>> lies{
    {"all times 10 ms late", [](auto& record) { shift(record, milliseconds(10)); }},
    {"all times 0.2 ms early", [](auto& record) { shift(record, -microseconds(200)); }},
    {"all times 1000 s late", [](auto& record) { shift(record, seconds(1000)); }},
    {"the high word of all times", [](auto& record) { shift(record, {std::int64_t{1} << 32U}); }},
    {"a period late", [](auto& record) { shift(record, milliseconds(50)); }},
    {"start 1 ms late", [](auto& record) { record.start_ns += 1'000'000; }},
    {"end 1 ms late", [](auto& record) { record.end_ns += 1'000'000; }},
    {"start before the trigger", [](auto& record) { record.start_ns -= 100'000; }},
    {"end before the start", [](auto& record) { std::swap(record.start_ns, record.end_ns); }},
    {"no time at all", [](auto& record) { record.end_ns = wire::no_time; }},
    {"trigger and 1000", [](auto& record) { record.trigger += 1000; }},
    {"the trigger before", [](auto& record) { --record.trigger; }},
    {"tick and trigger swapped", [](auto& record) { std::swap(record.tick, record.trigger); }},
    {"another tick", [](auto& record) { record.tick += 3; }},
    {"a tick beyond all bounds", [](auto& record) { record.tick = UINT64_MAX; }},
    {"flags of a prediction", [](auto& record) { record.flags = wire::exposure_predicted; }},
};

}  // namespace

TEST_CASE("camera_pipeline: a record that lies costs its own frame, and no other") {
    auto configuration = camera_at_rate(20);
    configuration.on_unproved = GENERATE(OnUnproved::withhold, OnUnproved::flag);
    PipelineBench bench(configuration);
    bench.pipeline.set_camera_exposure(milliseconds(4), bench.begin - seconds(10));
    const auto& [name, lie] = GENERATE(from_range(lies));
    INFO(name);
    bench.start();
    bench.run(12, 40);
    bench.lie = lie;
    bench.pass(40);
    bench.lie = [](wire::Exposure&) {};
    bench.run(41, 60);
    int good = 0;
    for (const FrameMetadata& frame : bench.published) {
        if ((frame.flags & flag_suspect) != 0) continue;
        ++good;
        const HostTime middle = bench.begin + bench.period * frame.tick() + microseconds(2020);
        CHECK(absolute(frame.host_time - middle) <= microseconds(1));
    }
    CHECK(good == 7 + 28 + 19);
    const auto report = bench.pipeline.report();
    CHECK(report.records_doubted == 1);
    CHECK(report.slips == 0);
    CHECK(report.locks == 1);
}

TEST_CASE("camera_pipeline: a replay believes the records that the service believed") {
    PipelineBench bench(camera_at_rate(20));
    auto evidence = bench.reader("cam0-evidence");
    std::mt19937_64 random(1);
    std::vector<bool> live;
    bench.lie = [&](wire::Exposure& record) {
        if (random() % 8 != 0) return;
        const std::int64_t by_ns = static_cast<std::int64_t>(random() % 200'000'000) - 100'000'000;
        switch (random() % 5) {
            case 0: record.start_ns += by_ns; break;
            case 1: record.end_ns += by_ns; break;
            case 2: record.tick += random() % 3; break;
            case 3: record.trigger += random() % 3; break;
            default:
                record.trigger_ns += by_ns;
                record.start_ns += by_ns;
                record.end_ns += by_ns;
        }
    };
    const auto pass = [&](std::uint64_t tick) {
        const std::uint64_t doubted = bench.pipeline.report().records_doubted;
        bench.pass(tick);
        live.push_back(bench.pipeline.report().records_doubted == doubted);
    };
    for (const std::uint64_t tick : pattern_ticks) pass(tick);
    for (std::uint64_t tick = 20; tick < 400; ++tick) {
        pass(tick);
        if (tick % 100 == 0) bench.pipeline.triggers_skipped(1);
    }

    struct Pairs final : pairing::Outcome {
        void paired(const pairing::Arrival& arrival, const pairing::Exposure&) override {
            ids.push_back(arrival.block_id);
        }
        void frame_unpaired(const pairing::Arrival&, EventReason,
                            const pairing::Exposure*) override {}
        void exposure_unpaired(const pairing::Exposure&, EventReason) override {}
        void locked(const pairing::Exposure&) override {}
        void slipped(const pairing::Arrival&) override {}
        std::vector<std::uint64_t> ids;
    } pairs;
    pairing::Replay replay(pairs);
    std::vector<bool> replayed;
    for (auto item = test::look(evidence.next()); item.found == test::Found::item;
         item = test::look(evidence.next())) {
        const auto input = pairing::from_metadata(unpack<pairing::EvidenceMetadata>(item.metadata));
        REQUIRE(input);
        replay.apply(*input);
        if (std::holds_alternative<pairing::ReceivedRecord>(*input))
            replayed.push_back(!replay.record_verdict()->doubt);
    }
    CHECK(replayed == live);
    CHECK(std::count(live.begin(), live.end(), false) > 20);
    std::vector<std::uint64_t> published;
    for (const FrameMetadata& frame : bench.published) published.push_back(frame.block_id);
    CHECK(pairs.ids == published);
    CHECK(published.size() > 200);
}

TEST_CASE("camera_pipeline: when the board's clock begins anew, the lock is dropped") {
    PipelineBench bench(camera_at_rate(20));
    bench.start();
    CHECK(bench.pipeline.report().pairing == pairing::State::locked);
    const Duration step = GENERATE(milliseconds(50), -milliseconds(100));
    bench.lie = [&](wire::Exposure& record) { shift(record, step); };
    bench.published.clear();
    for (std::uint64_t tick = 12; tick < 15; ++tick) {
        const HostTime at = bench.begin + bench.period * static_cast<std::int64_t>(tick);
        const BoardTime board = test::Pipelines::to_board(at) + step;
        CHECK_FALSE(bench.trigger(tick));
        bench.frame(tick);
        bench.translator.add({at - microseconds(10), board, board, at + microseconds(10)});
    }
    bench.run(15, 40);
    CHECK(bench.pipeline.report().pairing == pairing::State::searching);
    CHECK(bench.published.empty());
    CHECK(bench.pipeline.advance(host_now() + seconds(10)) == pairing::Start::pattern);
}

TEST_CASE(
    "camera_pipeline: records that agree on another grid are a step, with a lock of its own") {
    PipelineBench bench(camera_at_rate(20));
    bench.start();
    bench.lie = [](wire::Exposure& record) { shift(record, microseconds(1500)); };
    for (std::uint64_t tick = 12; tick < 20; ++tick) CHECK_FALSE(bench.trigger(tick));
    for (std::int64_t tick = 12; tick < 16; ++tick)
        bench.exchange(bench.begin + bench.period * tick);
    const auto before = bench.translator.output_now().epoch;
    CHECK(bench.trigger(20));
    CHECK(bench.translator.output_now().epoch == before);
    CHECK(bench.pipeline.report().pairing == pairing::State::searching);
}

TEST_CASE("camera_pipeline: a doubled frame is suspect, with the exposure that it seems to be of") {
    auto configuration = camera_at_rate(20);
    configuration.on_unproved = OnUnproved::flag;
    PipelineBench bench(configuration);
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    for (std::size_t i = 0; i < std::size(pattern_ticks); ++i) test::look(reader.next());
    bench.frame(pattern_ticks[std::size(pattern_ticks) - 1]);
    for (const std::uint64_t tick : {12U, 13U}) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    const auto frame = unpack<FrameMetadata>(item.metadata);
    CHECK((frame.flags & flag_suspect) != 0);
    CHECK(frame.trigger == std::size(pattern_ticks));
    CHECK(frame.sigma_ns == sigma_unknown);
}

TEST_CASE("camera_pipeline: after a reset, numbers that come again are no repeats") {
    PipelineBench bench(camera_at_rate(20));
    bench.trigger(0);
    bench.pipeline.reset();
    bench.triggers = 0;
    CHECK(bench.trigger(1));
}

TEST_CASE("camera_pipeline: nothing waits while rings are made [threads]", "[threads]") {
    auto configuration = camera_at_rate(20);
    test::Pipelines bench;
    CameraPipeline pipeline(configuration, 0, bench.translator, bench.events);
    std::atomic<bool> made{false};
    Duration making;
    Expected<> prepared;
    std::thread camera_thread([&] {
        const HostTime begin = host_now();
        prepared = pipeline.prepare(bench.directory.path(), 8 << 20, true);
        making = host_now() - begin;
        made = true;
    });
    Duration longest;
    while (!made) {
        const HostTime begin = host_now();
        pipeline.advance(begin);
        longest = std::max(longest, host_now() - begin);
        std::this_thread::yield();
    }
    camera_thread.join();
    REQUIRE(prepared);
    CHECK(longest < making / 2);
}

TEST_CASE("camera_pipeline: the middle of an exposure that an opto line shows is the true one") {
    PipelineBench bench(camera_at_rate(20));
    LineDelays lines;
    lines.line = "Line1";
    lines.start = {microseconds(36), microseconds(9)};
    lines.end = {microseconds(18), microseconds(5)};
    lines.source = DelaySource::preset;
    bench.pipeline.set_line_delays(lines);
    bench.pipeline.set_camera_exposure(microseconds(4018), bench.begin - seconds(10));
    auto reader = bench.reader("cam0");
    for (const std::uint64_t tick : pattern_ticks) {
        bench.trigger(tick);
        bench.frame(tick);
    }
    for (std::size_t i = 0; i < std::size(pattern_ticks); ++i) {
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        const auto frame = unpack<FrameMetadata>(item.metadata);
        const HostTime seen = bench.begin + bench.period * static_cast<std::int64_t>(frame.tick()) +
                              microseconds(2020);
        CHECK(absolute(frame.host_time - (seen - microseconds(27))) <= microseconds(1));
        CHECK(item.time.ns == frame.host_time.ns);
        CHECK(frame.exposure == microseconds(4018));
        CHECK(frame.delay_ns == 27'000);
        CHECK(frame.sigma_ns >= 7'000);
    }
    const PipelineReport report = bench.pipeline.report();
    CHECK(report.lines.start.delay == microseconds(36));
    CHECK(report.edges.difference == microseconds(-18));
    CHECK(report.edges.frames == std::size(pattern_ticks));
    CHECK(report.exposure == microseconds(4018));
}

TEST_CASE("camera_pipeline: a slow end of the exposure line is learned, and taken off the stamps") {
    PipelineBench bench(camera_at_rate(20));
    bench.pipeline.set_camera_exposure({}, bench.begin);  // it changes by itself
    bench.chunk = milliseconds(4);
    bench.lie = [](wire::Exposure& record) { record.end_ns += 400'000; };
    bench.start();
    bench.run(12, 40);
    CHECK(bench.published.size() == 7 + 28 - 8);
    for (const FrameMetadata& frame : bench.published) {
        const HostTime middle = bench.begin + bench.period * frame.tick() + microseconds(2020);
        CHECK(absolute(frame.host_time - middle) <= microseconds(1));
        CHECK(absolute(frame.exposure - milliseconds(4)) <= microseconds(1));
        CHECK(std::abs(frame.delay_ns - 200'000) <= 1000);
    }
    CHECK(bench.pipeline.report().edges.correction == microseconds(200));
    CHECK(bench.pipeline.report().slips == 0);
}

TEST_CASE("camera_pipeline: ends that are wrong now and then are withheld while it changes") {
    PipelineBench bench(camera_at_rate(20));
    bench.pipeline.set_camera_exposure({}, bench.begin);
    bench.chunk = milliseconds(4);
    bench.lie = [](wire::Exposure& record) {
        if (record.tick % 3 == 0) record.end_ns += 300'000;
    };
    bench.start();
    bench.run(12, 60);
    CHECK(bench.pipeline.report().exposure_source == ExposureSource::chunk);
    for (const FrameMetadata& frame : bench.published) CHECK(frame.tick() % 3 != 0);
    CHECK(bench.published.size() == 4 + 32);
}
