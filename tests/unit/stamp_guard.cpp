// SPDX-License-Identifier: BSD-3-Clause
#include "publish/stamp_guard.hpp"

#include <catch2/catch.hpp>

#include "simulated_clocks.hpp"

using namespace versavis;
using daemon::StampGuard;

namespace {

clock::Stamp guarded_stamp(std::int64_t ns, std::uint32_t epoch,
                           clock::ClockState state = clock::ClockState::locked) {
    clock::Stamp stamp;
    stamp.output = {ns};
    stamp.epoch = epoch;
    stamp.state = state;
    return stamp;
}

/// What one stream publishes of instants on the host clock.
struct StreamOfStamps {
    struct Published {
        OutputTime time;
        std::uint32_t epoch;
        std::uint32_t flags;
    };

    Published publish(HostTime host) {
        const clock::Stamp stamp = translator.translate(host, {});
        const auto guarded = guard.guard(stamp, 50'000).value();
        return {guarded.time, stamp.epoch, guarded.flags};
    }
    HostTime now() const { return {clocks->value_ns(clock::SystemClock::monotonic_raw)}; }

    std::shared_ptr<test::SimulatedClocks> clocks = std::make_shared<test::SimulatedClocks>();
    clock::Translator translator{
        *clock::OutputClock::create(clock::OutputClockKind::realtime, false, clocks)};
    StampGuard guard;
};

}  // namespace

TEST_CASE("stamp_guard: stamps never go backwards within an epoch, and say when they were held") {
    StampGuard guard;
    CHECK(guard.guard(guarded_stamp(100, 1), 10)->time.ns == 100);
    const auto held = guard.guard(guarded_stamp(90, 1), 10);
    REQUIRE(held);
    CHECK(held->time.ns == 101);
    CHECK(held->flags == flag_clamped);
    CHECK(guard.guard(guarded_stamp(50, 2), 10)->time.ns == 50);
    const auto late = guard.guard(guarded_stamp(60, 2, clock::ClockState::holdover), 10);
    CHECK(late->time.ns == 60);
    CHECK(late->flags == flag_holdover);
}

TEST_CASE("stamp_guard: sigma of a stamp that was held contains the hold") {
    StampGuard guard;
    guard.guard(guarded_stamp(100, 1), 30);
    CHECK(guard.guard(guarded_stamp(61, 1), 30)->sigma_ns == 50);
    CHECK(guard.guard(guarded_stamp(61, 1), sigma_unknown)->sigma_ns == sigma_unknown);
}

TEST_CASE(
    "stamp_guard: what sigma cannot explain is refused, until three in a row contradict the last") {
    StampGuard guard;
    guard.guard(guarded_stamp(1'000'000, 1), 30);
    for (int i = 0; i < 3; ++i) {
        CHECK_FALSE(guard.stuck());
        CHECK_FALSE(guard.guard(guarded_stamp(1000 + i, 1), 30));
    }
    CHECK(guard.stuck());
    CHECK(guard.guard(guarded_stamp(1003, 2), 30)->time.ns == 1003);
    CHECK_FALSE(guard.stuck());
}

TEST_CASE("stamp_guard: a suspect stamp neither holds others up nor is held") {
    StampGuard guard;
    guard.guard(guarded_stamp(100, 1), 30);
    CHECK(guard.guard(guarded_stamp(50, 1), sigma_unknown, true)->time.ns == 50);
    CHECK(guard.guard(guarded_stamp(9000, 1), sigma_unknown, true)->flags == 0);
    CHECK(guard.guard(guarded_stamp(200, 1), 30)->time.ns == 200);
}

TEST_CASE("stamp_guard: a clock that is set back begins a new epoch, with its own time at once") {
    StreamOfStamps stream;
    const auto before = stream.publish(stream.now());
    stream.clocks->step(-GENERATE(seconds(1), milliseconds(1), microseconds(50)));
    const auto after = stream.publish(stream.now());
    CHECK(after.epoch == before.epoch + 1);
    CHECK(after.time < before.time);
    CHECK(after.flags == 0);
    const auto next = stream.publish(stream.now() + milliseconds(1));
    CHECK(next.epoch == after.epoch);
    CHECK(next.time > after.time);
}

TEST_CASE("stamp_guard: a clock that is slewed back is held within its epoch") {
    StreamOfStamps stream;
    const HostTime instant = stream.now();
    const auto before = stream.publish(instant);
    stream.clocks->slew_ppb = -500'000;
    stream.clocks->pass(milliseconds(100));  // 50 us are lost meanwhile
    const auto held = stream.publish(instant + microseconds(20));
    CHECK(held.epoch == before.epoch);
    CHECK(held.time == before.time + nanoseconds(1));
    CHECK(held.flags == flag_clamped);
    const auto free = stream.publish(instant + microseconds(60));
    CHECK(free.time > held.time);
    CHECK(free.flags == 0);
}

TEST_CASE("stamp_guard: an estimate that goes back further than its sigma explains is refused") {
    StreamOfStamps stream;
    // The board's clock is the host's; the first exchange is lopsided by 2 ms.
    const auto exchange = [&](std::int64_t at_ns, std::int64_t up_ns) {
        stream.translator.add(
            {{at_ns}, {at_ns + 10'000}, {at_ns + 10'000}, {at_ns + 20'000 + up_ns}});
    };
    const auto publish = [&](BoardTime board) {
        const auto stamp = stream.translator.translate(board);
        REQUIRE(stamp);
        return stream.guard.guard(*stamp, stamp->sigma_ns);
    };
    const std::int64_t begin_ns = stream.now().ns;
    for (int i = 0; i < 2; ++i) exchange(begin_ns, 2'000'000);
    REQUIRE(publish({begin_ns + 300'000'000}));
    for (int i = 1; i <= 20; ++i) exchange(begin_ns + i * 10'000'000, 0);
    CHECK_FALSE(publish({begin_ns + 300'100'000}));
    CHECK(publish({begin_ns + 302'000'000})->flags == 0);
}

TEST_CASE("stamp_guard: a stamp whose second is doubted says so") {
    StampGuard guard;
    clock::Stamp doubted = guarded_stamp(1000, 1);
    CHECK(guard.guard(doubted, 10)->flags == 0);
    doubted.second_doubted = true;
    doubted.output = {2000};
    CHECK(guard.guard(doubted, 10)->flags == flag_second_doubted);
}
