// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/answer_watch.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// A camera at 20 Hz and its board.
struct AnswerBench {
    /// A trigger that the camera takes or ignores.
    void trigger(bool taken, std::uint16_t flags = 0, Duration latency = microseconds(20)) {
        ++number;
        wire::Exposure record{};
        record.trigger = number;
        record.trigger_ns = static_cast<std::int64_t>(number) * 50'000'000;
        record.start_ns = taken ? record.trigger_ns + latency.ns : wire::no_time;
        record.end_ns = taken ? record.start_ns + 3'000'000 : wire::no_time;
        record.flags = static_cast<std::uint16_t>(
            flags | (taken ? wire::exposure_measured : wire::exposure_no_start));
        watch.recorded(record);
    }

    /// A trigger whose record has the start of the next exposure, as a line that leads makes it.
    void leading_trigger(Duration lead) { trigger(true, 0, milliseconds(50) - lead); }

    void frame(std::uint64_t id, Duration late = {}) {
        elapsed = elapsed + milliseconds(50);
        pairing::Arrival arrival;
        arrival.block_id = id;
        arrival.camera_time = CameraTime{static_cast<std::int64_t>(
            static_cast<double>(elapsed.ns) * rate + static_cast<double>(step.ns))};
        arrival.arrived = HostTime{1'000'000'000} + elapsed + late;
        watch.arrived(arrival);
    }

    std::uint64_t number = 0;
    Duration elapsed;
    double rate = 1;
    Duration step;  ///< of the camera's clock
    AnswerWatch watch{milliseconds(50)};
};

}  // namespace

TEST_CASE("answer_watch: which triggers the camera takes, by its exposure line") {
    for (const unsigned every : {1U, 2U, 3U}) {
        AnswerBench bench;
        for (unsigned i = 0; i < 8 * every; ++i) bench.trigger(i % every == 0);
        CHECK(bench.watch.report().every == 1);
        for (unsigned i = 0; i < every; ++i) bench.trigger(i % every == 0);
        CHECK(bench.watch.report().every == every);
        CHECK(bench.watch.report().shortest == milliseconds(50) * every);
        CHECK(bench.watch.report().ignored == 9 * (every - 1));
        bench.watch.restart();
        CHECK(bench.watch.report().every == 1);
        CHECK(bench.watch.report().shortest.ns == 0);
        CHECK(bench.watch.report().ignored == 9 * (every - 1));
    }
}

TEST_CASE("answer_watch: triggers ignored at random are counted, and no pattern") {
    AnswerBench bench;
    for (unsigned i = 0; i < 40; ++i) bench.trigger(i % 5 != 0);
    CHECK(bench.watch.report().ignored == 8);
    CHECK(bench.watch.report().every == 1);
    CHECK(bench.watch.report().shortest == milliseconds(50));
}

TEST_CASE("answer_watch: without an own exposure line, nobody knows what the camera took") {
    AnswerBench bench;
    for (const auto flag : {wire::exposure_predicted, wire::exposure_from_master})
        for (unsigned i = 0; i < 20; ++i) bench.trigger(i % 2 == 0, flag);
    CHECK(bench.watch.report().ignored == 0);
    CHECK(bench.watch.report().every == 1);
}

TEST_CASE(
    "answer_watch: ids that stand still or begin again are counted, frames out of order not") {
    AnswerBench bench;
    for (const std::uint64_t id : {100, 101, 101, 101, 102, 85, 86, 1, 2}) bench.frame(id);
    CHECK(bench.watch.report().ids_repeated == 2);
    CHECK(bench.watch.report().ids_restarted == 2);
    CHECK(bench.watch.report().block_id == 2);
}

TEST_CASE("answer_watch: ids of frames that did not arrive are counted, and no restart is") {
    AnswerBench bench;
    for (const std::uint64_t id : {100, 101, 104, 104, 105, 1, 2, 4}) bench.frame(id);
    CHECK(bench.watch.report().ids_skipped == 3);
    bench.watch.restart();
    bench.frame(50);
    CHECK(bench.watch.report().ids_skipped == 3);
}

TEST_CASE("answer_watch: a clock in another unit is known, one that steps or drifts is not") {
    for (const auto& [rate, found] : {std::pair{8.0, 8.0},
                                      {0.001, 0.001},
                                      {1.6, 1.6},
                                      {0.125, 0.125},
                                      {1.4, 1.0},
                                      {0.21, 1.0},
                                      {1.0005, 1.0},
                                      {0.0, 1.0}}) {
        AnswerBench bench;
        bench.rate = rate;
        for (unsigned i = 0; i < 32; ++i) bench.frame(i);
        CHECK(bench.watch.report().clock_rate == 1);
        bench.frame(32);
        CHECK(bench.watch.report().clock_rate == Approx(found).epsilon(0.001));
    }
    AnswerBench stepped;
    AnswerBench late;
    for (unsigned i = 0; i < 200; ++i) {
        if (i % 70 == 40) stepped.step = stepped.step + seconds(1);
        stepped.frame(i);
        late.frame(i, milliseconds(i % 7 == 0 ? 45 : 0));
    }
    CHECK(stepped.watch.report().clock_rate == 1);
    CHECK(late.watch.report().clock_rate == 1);
}

TEST_CASE("answer_watch: an exposure line that rises before its trigger leads") {
    AnswerBench bench;
    for (int i = 0; i < 4; ++i) bench.leading_trigger(microseconds(380));
    bench.trigger(false);  // before a gap of the pattern
    CHECK(bench.watch.report().lead.ns == 0);
    bench.leading_trigger(microseconds(380));
    CHECK(bench.watch.report().lead == microseconds(380));
    bench.trigger(false);  // in a slow start
    CHECK(bench.watch.report().lead == microseconds(380));
    bench.trigger(true);
    CHECK(bench.watch.report().lead.ns == 0);
    for (int i = 0; i < 9; ++i) bench.leading_trigger(milliseconds(7));  // it starts late
    CHECK(bench.watch.report().lead.ns == 0);
    for (int i = 0; i < 9; ++i) bench.leading_trigger(milliseconds(4));
    CHECK(bench.watch.report().lead == milliseconds(4));
    bench.watch.restart();
    CHECK(bench.watch.report().lead.ns == 0);
}
