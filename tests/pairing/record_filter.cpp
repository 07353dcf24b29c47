// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/record_filter.hpp"

#include <rapidcheck.h>
#include <catch2/catch.hpp>
#include <functional>

using namespace versavis;
using namespace versavis::pairing;

namespace {

RecordLimits camera() {
    RecordLimits limits;
    limits.exposure = milliseconds(4);
    limits.max_exposure = milliseconds(40);
    return limits;
}

/// The record of the trigger at `tick`, as the board sends it: its middle is on the grid if the
/// exposure is as expected.
wire::Exposure record(std::uint64_t tick, Duration exposure, Duration expected) {
    wire::Exposure made{};
    made.trigger = made.tick = tick;
    made.flags = wire::exposure_measured;
    made.trigger_ns = static_cast<std::int64_t>(tick) * 50'000'000 - expected.ns / 2;
    made.start_ns = made.trigger_ns + 20'000;
    made.end_ns = made.start_ns + exposure.ns;
    return made;
}

wire::Exposure displaced(wire::Exposure made, std::uint64_t trigger, Duration by) {
    made.trigger = trigger;
    made.trigger_ns += by.ns;
    made.start_ns += by.ns;
    made.end_ns += by.ns;
    return made;
}

struct FilterBench {
    FilterBench() {
        // What is confirmed is no longer overturned by those that contradict it.
        for (std::uint64_t tick = 1; tick <= before; ++tick)
            REQUIRE(believes(record(tick, milliseconds(4), milliseconds(4))));
    }

    bool believes(const wire::Exposure& made, Duration commanded = {}) {
        ReceivedRecord received;
        received.record = made;
        received.commanded = commanded;
        return !filter.judge(received).doubt;
    }

    static constexpr std::uint64_t before = 3;
    RecordFilter filter{camera()};
};

}  // namespace

TEST_CASE("record_filter: exposures that vary move the triggers, and are believed") {
    FilterBench bench;
    Duration expected = milliseconds(4);
    const std::vector<Duration> exposures{milliseconds(4),  milliseconds(4), milliseconds(30),
                                          milliseconds(30), milliseconds(2), milliseconds(2),
                                          milliseconds(17), milliseconds(1)};
    for (std::uint64_t tick = FilterBench::before + 1; tick < 100; ++tick) {
        const Duration exposure = exposures[tick % exposures.size()];
        CHECK(bench.believes(record(tick, exposure, expected)));
        expected = exposure;
    }
}

TEST_CASE("record_filter: an exposure of which the camera says that it is fixed stays so") {
    FilterBench bench;
    const Duration fixed = milliseconds(4);
    for (std::uint64_t tick = FilterBench::before + 1; tick < 40; ++tick)
        CHECK(bench.believes(record(tick, fixed, fixed), fixed));
    CHECK_FALSE(bench.believes(record(40, fixed + microseconds(150), fixed), fixed));
    // Set anew, the new one is learned.
    CHECK(bench.believes(record(41, milliseconds(9), fixed), milliseconds(9)));
    CHECK_FALSE(bench.believes(record(42, milliseconds(11), milliseconds(9)), milliseconds(9)));
}

TEST_CASE("record_filter: lost records, skipped triggers and late ones are no contradiction") {
    FilterBench bench;
    const Duration fixed = milliseconds(4);
    for (std::uint64_t tick = FilterBench::before + 1; tick < 20; ++tick)
        bench.believes(record(tick, fixed, fixed));
    wire::Exposure skipped = record(25, fixed, fixed);
    skipped.trigger = 22;
    CHECK_FALSE(bench.believes(skipped));
    bench.filter.triggers_skipped(1);
    CHECK_FALSE(bench.believes(skipped));
    bench.filter.triggers_skipped(2);
    CHECK(bench.believes(skipped));
    wire::Exposure late = displaced(record(26, fixed, fixed), 23, microseconds(1500));
    CHECK_FALSE(bench.believes(late));
    late.flags |= wire::exposure_late;
    CHECK(bench.believes(late));
    // It excuses nothing in those after it.
    CHECK_FALSE(bench.believes(displaced(record(27, fixed, fixed), 24, microseconds(500))));
    wire::Exposure next = record(27, fixed, fixed);
    next.trigger = 24;
    CHECK(bench.believes(next));
}

TEST_CASE("record_filter: flags say which line there is") {
    RecordLimits limits = camera();
    const bool wired = limits.wired = GENERATE(true, false);
    const bool slave = limits.slave = GENERATE(true, false);
    wire::Exposure made = record(1, milliseconds(4), milliseconds(4));
    const auto agrees = [&](unsigned flags) {
        made.flags = static_cast<std::uint16_t>(flags);
        return !contradicts_itself(made, limits);
    };
    CHECK(agrees(wire::exposure_measured) == wired);
    CHECK(agrees(wire::exposure_measured | wire::exposure_from_master) == (!wired && slave));
    CHECK(agrees(wire::exposure_predicted) == (!wired && !slave));
    CHECK_FALSE(agrees(wire::exposure_no_start));
    CHECK_FALSE(agrees(wire::exposure_no_end));
    CHECK_FALSE(agrees(0));
}

TEST_CASE("record_filter: no field of a record overflows anything") {
    FilterBench bench;
    for (std::uint64_t tick = FilterBench::before + 1; tick < 20; ++tick)
        bench.believes(record(tick, milliseconds(4), milliseconds(4)));
    CHECK(rc::check("random fields", [&] {
        wire::Exposure made = record(20, milliseconds(4), milliseconds(4));
        if (*rc::gen::arbitrary<bool>()) made.trigger = *rc::gen::arbitrary<std::uint64_t>();
        if (*rc::gen::arbitrary<bool>()) made.tick = *rc::gen::arbitrary<std::uint64_t>();
        if (*rc::gen::arbitrary<bool>())
            made.trigger_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        if (*rc::gen::arbitrary<bool>())
            made.start_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        if (*rc::gen::arbitrary<bool>())
            made.end_ns = *rc::gen::inRange<std::int64_t>(0, std::int64_t{1} << 60);
        const wire::Exposure honest = record(20, milliseconds(4), milliseconds(4));
        const bool damaged = made.trigger != honest.trigger || made.tick != honest.tick ||
                             made.trigger_ns != honest.trigger_ns ||
                             made.start_ns != honest.start_ns || made.end_ns != honest.end_ns;
        FilterBench fresh = bench;
        const bool believed = fresh.believes(made);
        RC_ASSERT(believed != damaged || (believed && made.trigger == 20 && made.tick == 20));
    }));
}

TEST_CASE("record_filter: a record that comes at an impossible time is doubted, whatever it says") {
    FilterBench bench;
    ReceivedRecord received;
    received.record = record(4, milliseconds(4), milliseconds(4));
    received.expected_ns = 17;
    received.arrival = GENERATE(EventReason::not_yet, EventReason::too_old);
    const RecordVerdict verdict = bench.filter.judge(received);
    REQUIRE(verdict.doubt);
    CHECK(verdict.doubt->reason == received.arrival);
    CHECK(verdict.doubt->said == received.record.end_ns);
    CHECK(verdict.doubt->expected == 17);
    CHECK(bench.filter.verdict().doubt);
    received.arrival = EventReason::none;
    CHECK_FALSE(bench.filter.judge(received).doubt);
}

TEST_CASE("record_filter: three that agree on another time are a step, if the clock agrees, too") {
    FilterBench bench;
    const auto judge = [&](std::uint64_t tick, std::uint64_t exchanges, EventReason arrival,
                           bool contradicted) {
        ReceivedRecord received;
        received.record =
            displaced(record(tick, milliseconds(4), milliseconds(4)), tick, milliseconds(10));
        received.exchanges = exchanges;
        received.arrival = arrival;
        received.clock_contradicted = contradicted;
        return bench.filter.judge(received);
    };
    const auto doubted = [&](const RecordVerdict& verdict) {
        return verdict.doubt && !verdict.step && !verdict.overturned;
    };
    CHECK(doubted(judge(4, 10, EventReason::none, false)));
    CHECK(doubted(judge(5, 12, EventReason::none, false)));
    CHECK(doubted(judge(6, 13, EventReason::none, false)));  // three exchanges since
    CHECK(doubted(judge(7, 14, EventReason::none, true)));
    CHECK(doubted(judge(8, 15, EventReason::not_yet, false)));
    const RecordVerdict step = judge(9, 16, EventReason::none, false);
    CHECK_FALSE(step.doubt);
    REQUIRE(step.step);
    CHECK(step.step->reason == EventReason::implausible_time);
    CHECK_FALSE(judge(10, 16, EventReason::none, false).step);
    CHECK_FALSE(bench.filter.verdict().doubt);
}

TEST_CASE("record_filter: before three agree, one that contradicts them makes them void") {
    RecordFilter filter{camera()};
    ReceivedRecord received;
    received.record = record(7, milliseconds(4), milliseconds(4));
    CHECK_FALSE(filter.judge(received).overturned);
    received.record = displaced(record(8, milliseconds(4), milliseconds(4)), 8, milliseconds(10));
    const RecordVerdict verdict = filter.judge(received);
    CHECK(verdict.overturned);
    CHECK_FALSE(verdict.doubt);
}

TEST_CASE("record_filter: what was believed is known until all is forgotten") {
    FilterBench bench;
    wire::Exposure other = record(3, milliseconds(4), milliseconds(4));
    CHECK_FALSE(bench.filter.disputes_newest(other));
    ++other.start_ns;
    CHECK(bench.filter.disputes_newest(other));
    // The grid moves, and triggers are counted on.
    bench.filter.forget_grid();
    CHECK_FALSE(bench.believes(
        displaced(record(5, milliseconds(4), milliseconds(4)), 3, milliseconds(20))));
    CHECK(bench.believes(
        displaced(record(5, milliseconds(4), milliseconds(4)), 4, milliseconds(20))));
    bench.filter.forget();
    CHECK(bench.believes(record(1, milliseconds(4), milliseconds(4))));
}

TEST_CASE("record_filter: what varies its exposure on a fixed grid is believed, a drift is not") {
    RecordLimits limits = camera();
    limits.fixed_grid = true;
    RecordFilter filter{limits};
    Duration expected = milliseconds(4);
    std::uint64_t tick = 1;
    const auto judge = [&](Duration off, Duration exposure) {
        ReceivedRecord received;
        received.record = displaced(record(tick, exposure, expected), tick, off);
        received.promptness = Promptness::usual;
        ++tick;
        expected = exposure;
        return filter.judge(received);
    };
    for (const std::int64_t us : {4000, 4000, 30'000, 30'000, 2000, 2000, 17'000, 1000, 4000})
        CHECK_FALSE(judge({}, microseconds(us)).doubt);
    for (int i = 0; i < 100; ++i) CHECK_FALSE(judge({}, milliseconds(4)).doubt);
    const Duration each = GENERATE(nanoseconds(100), microseconds(1), microseconds(10));
    Duration off;
    Duration believed;
    for (int i = 0; i < 1000; ++i) {
        off = off + each;
        if (!judge(off, milliseconds(4)).doubt) believed = off;
    }
    CHECK(believed < microseconds(25));
    CHECK_FALSE(judge({}, milliseconds(4)).doubt);
}

TEST_CASE("record_filter: a fixed grid is where it was after a new start of the camera") {
    RecordLimits limits = camera();
    limits.fixed_grid = true;
    RecordFilter filter{limits};
    std::uint64_t trigger = 0;
    const auto believes = [&](std::uint64_t tick, Duration off) {
        ReceivedRecord received;
        received.record = displaced(record(tick, milliseconds(4), milliseconds(4)), ++trigger, off);
        received.promptness = Promptness::usual;
        return !filter.judge(received).doubt;
    };
    for (std::uint64_t tick = 1; tick < 30; ++tick) CHECK(believes(tick, {}));
    filter.forget_grid();
    CHECK_FALSE(believes(40, milliseconds(1)));
    CHECK(believes(41, {}));
    filter.forget();
    CHECK(believes(42, milliseconds(1)));
}

namespace {

/// A camera on a fixed grid, after 50 records: one per tick, and an exchange with each.
struct SteppedCamera {
    SteppedCamera() {
        for (int i = 0; i < 50; ++i) CHECK(believes({}, Promptness::usual));
    }

    static RecordLimits limits() {
        RecordLimits limits = camera();
        limits.fixed_grid = true;
        return limits;
    }
    ReceivedRecord received(Duration off, Promptness promptness) {
        ReceivedRecord received;
        ++tick;
        received.record = displaced(record(tick, milliseconds(4), milliseconds(4)), tick, off);
        received.promptness = promptness;
        received.exchanges = tick;
        if (grid) received.grid_ns = grid(received.record, off);
        return received;
    }
    bool believes(Duration off, Promptness promptness) {
        return !filter.judge(received(off, promptness)).doubt;
    }

    std::function<std::int64_t(const wire::Exposure& record, Duration off)> grid;

    RecordFilter filter{limits()};
    std::uint64_t tick = 0;
};

}  // namespace

TEST_CASE("record_filter: a step is believed when its delay confirms it, or nothing but time can") {
    SteppedCamera bench;
    struct Step {
        Duration off;
        Promptness promptness;
        std::uint64_t believed_after;
    };
    const auto [off, promptness, believed_after] = GENERATE(
        Step{milliseconds(1), Promptness::usual, 5}, Step{-milliseconds(1), Promptness::usual, 5},
        Step{milliseconds(1), Promptness::early, 97},
        Step{-milliseconds(1), Promptness::late, 1 + least_to_prevail},
        Step{microseconds(300), Promptness::usual, 97},
        Step{milliseconds(1), Promptness::unknown, 97});
    std::uint64_t records = 1;
    while (!bench.believes(off, promptness) && records < 1000) ++records;
    INFO(off.ns << " ns, " << static_cast<int>(promptness));
    CHECK(records == believed_after);
}

TEST_CASE("record_filter: what the board said of its grid before decides a step of its triggers") {
    // Half of the exposure that is expected, 4 ms, is taken off the grid point.
    const auto grid = [](Duration moved) {
        return [moved](const wire::Exposure& record, Duration off) {
            return record.trigger_ns - off.ns + 2'000'000 + moved.ns;
        };
    };
    struct Step {
        Duration off;
        Duration grid;  ///< off what records said before
        Promptness promptness;
        std::uint64_t believed_after;
    };
    constexpr std::uint64_t at_last = most_to_prevail + 1;
    const auto [off, moved, promptness, believed_after] =
        GENERATE(Step{microseconds(200), {}, Promptness::usual, at_last},
                 Step{-microseconds(200), {}, Promptness::late, at_last},
                 Step{milliseconds(1), {}, Promptness::usual, at_last},
                 Step{microseconds(200), microseconds(200), Promptness::usual, 5},
                 Step{-microseconds(200), -microseconds(200), Promptness::late, 5},
                 Step{milliseconds(1), milliseconds(1), Promptness::early, 5},
                 // It is refuted itself.
                 Step{milliseconds(1), milliseconds(3), Promptness::usual, 5},
                 Step{microseconds(200), milliseconds(3), Promptness::usual, 97});
    SteppedCamera bench;
    bench.grid = grid(moved);
    std::uint64_t records = 1;
    while (!bench.believes(off, promptness) && records < 2000) ++records;
    INFO(off.ns << " ns, grid " << moved.ns);
    CHECK(records == believed_after);
}

TEST_CASE("record_filter: a missing record does not let the next one lie elsewhere") {
    SteppedCamera bench;
    const auto off = GENERATE(microseconds(200), -microseconds(200), milliseconds(1));
    for (const int missing : {1, 3, 30}) {
        bench.tick += missing;
        CHECK_FALSE(bench.believes(off, Promptness::usual));
        CHECK(bench.believes({}, Promptness::usual));
    }
}

TEST_CASE("record_filter: after a missing record, another exposure costs one record at most") {
    SteppedCamera bench;
    ++bench.tick;
    ReceivedRecord received = bench.received({}, Promptness::usual);
    received.record = record(bench.tick, milliseconds(12), milliseconds(15));
    CHECK(bench.filter.judge(received).doubt);
    for (int i = 0; i < 10; ++i) {
        received = bench.received({}, Promptness::usual);
        received.record = record(bench.tick, milliseconds(12), milliseconds(12));
        CHECK_FALSE(bench.filter.judge(received).doubt);
    }
}

TEST_CASE("record_filter: a record that may lie anywhere is not confirmed by the grid") {
    SteppedCamera bench;
    bench.grid = [](const wire::Exposure& record, Duration off) {
        return record.trigger_ns - off.ns + 2'000'000;
    };
    for (int i = 0; i < 30; ++i) {
        if (i == 5) ++bench.tick;  // one is missing: another exposure may have been expected
        CHECK_FALSE(bench.believes(microseconds(200), Promptness::usual));
    }
}

TEST_CASE("record_filter: a start that leaves its trigger is not confirmed by the grid") {
    SteppedCamera bench;
    bench.grid = [](const wire::Exposure& record, Duration) {
        return record.trigger_ns + 2'000'000;
    };
    for (int i = 0; i < 60; ++i) {
        ReceivedRecord received = bench.received({}, Promptness::unknown);
        received.record.start_ns += 200'000;
        received.record.end_ns += 200'000;
        CHECK(bench.filter.judge(received).doubt);
    }
}

TEST_CASE("record_filter: usual delays among more early ones do not confirm a step") {
    SteppedCamera bench;
    for (int i = 0; i < 45; ++i) {
        const bool held_up = i % 3 == 2;
        CHECK_FALSE(
            bench.believes(milliseconds(1), held_up ? Promptness::usual : Promptness::early));
    }
    int usual = 0;
    while (!bench.believes(milliseconds(1), Promptness::usual)) ++usual;
    CHECK(usual == 14);
}
