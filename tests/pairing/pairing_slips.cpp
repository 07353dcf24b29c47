// SPDX-License-Identifier: BSD-3-Clause
// Kinds of evidence that contradict each other: what is waited for, believed and given up.
#include <catch2/catch.hpp>

#include "pairing_bench.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

/// Of a camera whose exposure line is not wired: triggers may have been ignored.
Exposure unseen(Exposure exposure) {
    exposure.kind = StampKind::trigger_edge;
    return exposure;
}

/// A frame that nothing explains.
void take_stray(Bench& bench) {
    const Exposure one = bench.next();
    bench.pairing.add(one);
    Arrival stray = bench.frame(bench.next_id + 500, one);
    stray.camera_time = stray.camera_time + seconds(40);
    bench.pairing.add(stray);
    ++bench.next_id;
}

Arrival late_frame(Bench& bench, const Exposure& of) {
    Arrival frame = bench.frame(bench.next_id++, of);
    frame.arrived = frame.arrived + milliseconds(40);
    return frame;
}

}  // namespace

TEST_CASE(
    "pairing_slips: a late frame needs one on time behind it, where triggers may be ignored") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure one = unseen(bench.next());
    const Exposure two = unseen(bench.next());
    bench.pairing.add(one);
    bench.pairing.add(late_frame(bench, one));
    CHECK(bench.decided.pairs.empty());
    bench.pairing.add(two);
    CHECK(bench.decided.pairs.empty());
    bench.pairing.add(bench.frame(bench.next_id++, two));
    CHECK(bench.decided.pairs.size() == 2);
    CHECK(bench.decided.slips.empty());
}

TEST_CASE("pairing_slips: a late frame needs none where each exposure was measured") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure one = bench.next();
    bench.pairing.add(one);
    bench.pairing.add(late_frame(bench, one));
    CHECK(bench.decided.pairs.size() == 1);
    // ... but a missing record in between leaves a choice.
    bench.next();
    const Exposure two = bench.next();
    bench.pairing.add(two);
    bench.next_id += 1;
    bench.pairing.add(late_frame(bench, two));
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_slips: frames that stay late are a slip, and each wait is its own") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure one = unseen(bench.next());
    bench.pairing.add(one);
    const Arrival late = late_frame(bench, one);
    bench.pairing.add(late);
    bench.pairing.advance(late.arrived + usual_exposure_wait + nanoseconds(1));
    CHECK(bench.decided.slips.size() == 1);
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::unproved);
    CHECK(bench.pairing.state() == State::checking);
    bench.tick += 10;
    bench.take();
    REQUIRE(bench.pairing.state() == State::locked);
    // The next one that waits does so for its record alone.
    bench.decided = {};
    const Arrival waits = bench.frame(bench.next_id++, bench.next());
    bench.pairing.add(waits);
    bench.pairing.advance(waits.arrived + usual_exposure_wait + nanoseconds(1));
    CHECK(bench.decided.slips.empty());
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::exposure_missing);
}

TEST_CASE("pairing_slips: frames that come later and later are evidence for none") {
    Bench bench;
    bench.lock();
    for (int i = 0; i < 400; ++i) {  // they wait for each other somewhere
        bench.frame_after = milliseconds(20) + microseconds(120) * i;
        bench.take();
    }
    REQUIRE(bench.decided.slips.empty());
    bench.decided = {};
    for (int i = 0; i < 3; ++i) {
        const Exposure one = unseen(bench.next());
        bench.pairing.add(one);
        bench.pairing.add(bench.frame(bench.next_id++, one));
    }
    CHECK(bench.decided.pairs.empty());
}

TEST_CASE("pairing_slips: what agreed at an earlier slip counts for nothing at the next") {
    Bench bench;
    bench.lock();
    const auto take_two = [&] {
        bench.next_id += 3;
        bench.take();
        bench.take();
        CHECK(bench.pairing.state() == State::checking);
        bench.next_id -= 3;
        bench.take();
        CHECK(bench.pairing.state() == State::locked);
    };
    bench.decided = {};
    take_two();
    CHECK(bench.decided.pairs.size() == 1);
    take_two();
    CHECK(bench.decided.pairs.size() == 2);
    CHECK(bench.decided.slips.size() == 2);
}

TEST_CASE("pairing_slips: frames of an earlier slip are not counted at the next") {
    Bench bench;
    bench.lock();
    for (int round = 0; round < 2; ++round) {
        for (int i = 0; i < 4; ++i) {
            take_stray(bench);
            CHECK(bench.pairing.state() == State::checking);
        }
        bench.take();
        CHECK(bench.pairing.state() == State::locked);
    }
}

TEST_CASE("pairing_slips: three frames in a row must agree, and one without a time does not") {
    Bench bench;
    // The camera's clock passes zero at the second frame after the slip.
    const std::int64_t at = 12 + 8 + 10;
    bench.camera_ahead = -(Bench::exposure(0, at + 2).start - BoardTime{});
    bench.lock();
    REQUIRE(bench.tick == static_cast<std::uint64_t>(at));
    bench.decided = {};
    bench.next_id += 3;
    for (int i = 1; i <= 5; ++i) {
        CHECK(bench.decided.pairs.empty());
        bench.take();
    }
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_slips: a clock that steps by whole periods hits other exposures, and is lost") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    bench.camera_ahead = bench.camera_ahead - period * 2;
    for (int i = 0; i < 5; ++i) {
        CHECK(bench.pairing.state() != State::searching);
        bench.take();
    }
    CHECK(bench.pairing.state() == State::searching);
    CHECK(bench.decided.pairs.empty());
}

TEST_CASE("pairing_slips: a clock that steps is followed over pauses, and from the first record") {
    Bench bench;
    bench.lock();
    bench.pairing.advance(bench.now + seconds(2));  // all that was recorded is given up
    bench.decided = {};
    bench.camera_ahead = bench.camera_ahead + seconds(11);
    for (int i = 0; i < 3; ++i) bench.take(60);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_slips: a clock that steps is not followed while ids leave a choice") {
    for (const bool taken : {true, false}) {
        Bench bench;
        bench.frame_after = milliseconds(60);
        bench.lock();
        bench.decided = {};
        bench.camera_ahead = bench.camera_ahead + seconds(11);
        bench.next();  // without record
        if (taken) ++bench.next_id;
        for (int i = 0; i < 8; ++i) bench.take();
        CHECK(bench.decided.pairs.empty());
        CHECK(bench.pairing.state() == State::searching);
    }
}

TEST_CASE("pairing_slips: while it checks, frames of before are out of order") {
    Bench bench;
    bench.lock();
    const Exposure newest = Bench::exposure(bench.next_trigger - 1, bench.tick);
    const Arrival again = bench.frame(bench.next_id - 1, newest);
    bench.next_id += 3;
    bench.take();
    REQUIRE(bench.pairing.state() == State::checking);
    bench.decided = {};
    // It waits for a record, as does the one behind it; both are decided when that comes.
    const Exposure one = bench.next();
    Arrival repeated = again;
    repeated.arrived = bench.frame(0, one).arrived;
    bench.pairing.add(repeated);
    bench.pairing.add(bench.frame(bench.next_id - 3, one));
    CHECK(bench.decided.frames.empty());
    bench.pairing.add(one);
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::out_of_order);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_slips: one record decides all frames that waited for it") {
    Bench bench;
    bench.frame_after = milliseconds(60);
    bench.lock();
    take_stray(bench);
    const Exposure one = bench.next();
    bench.pairing.add(one);
    REQUIRE(bench.pairing.state() == State::checking);
    bench.decided = {};
    SECTION("the first ends the check") {
        const Exposure two = bench.next();
        for (const Exposure& of : {one, two}) bench.pairing.add(bench.frame(bench.next_id++, of));
        CHECK(bench.decided.pairs.empty());
        bench.pairing.add(two);
        CHECK(bench.decided.pairs.size() == 2);
    }
    SECTION("the first is given up") {
        Arrival stray = bench.frame(bench.next_id + 500, one);
        stray.camera_time = stray.camera_time + seconds(40);
        bench.pairing.add(stray);
        bench.pairing.add(bench.frame(bench.next_id++, one));
        CHECK(bench.decided.frames.empty());
        bench.pairing.add(bench.next());
        CHECK(bench.decided.frames.size() == 1);
        CHECK(bench.decided.pairs.size() == 1);
    }
}

TEST_CASE("pairing_slips: without any record, a frame that is checked waits") {
    Bench bench;
    bench.lock();
    take_stray(bench);
    bench.pairing.advance(bench.now + seconds(3));
    bench.decided = {};
    const Exposure one = bench.next(60);
    bench.pairing.add(bench.frame(bench.next_id++, one));
    CHECK(bench.decided.frames.empty());
    bench.pairing.add(one);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_slips: two instants that name two exposures are a slip") {
    Limits limits = Bench::made();
    limits.stamped = Instant::unknown;
    Bench bench(limits);
    bench.lock();
    bench.decided = {};
    bench.next();  // without record: the ids leave a choice
    Exposure before = bench.next();
    before.end = before.start + milliseconds(43);
    Exposure after = bench.next();
    after.end = after.start + milliseconds(30);
    for (Exposure* one : {&before, &after}) {
        one->end_on_host = one->earliest_on_host = HostTime{one->end.ns} + host_ahead;
        one->recorded = one->end_on_host + record_after;
        bench.pairing.add(*one);
    }
    // Its time is the start of one, and close to the end of the other.
    bench.pairing.add(bench.frame(bench.next_id + 1, after));
    CHECK(bench.decided.slips.size() == 1);
    // Only with the arrival there is one that all agree on, and the ids' choice takes three.
    bench.next_id += 2;
    bench.take();
    CHECK(bench.decided.pairs.empty());
    bench.take();
    CHECK(bench.decided.pairs == decltype(bench.decided.pairs){{26, 27}});
}

TEST_CASE("pairing_slips: what is lost while nothing is known is unproved, and of no exposure") {
    Bench bench;
    bench.lock();
    while (bench.pairing.state() != State::searching) take_stray(bench);
    bench.decided = {};
    Exposure one;
    for (int i = 0; i < 40; ++i) {
        one = bench.next();
        bench.pairing.add(one);
    }
    const Arrival frame = bench.frame(bench.next_id, one);
    bench.pairing.add(frame);
    bench.pairing.advance(frame.arrived + seconds(20));
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::unproved);
    CHECK(bench.decided.frames[0].guess == 0);
    REQUIRE_FALSE(bench.decided.pulses.empty());
    for (const auto& pulse : bench.decided.pulses) CHECK(pulse.reason == EventReason::unproved);
}

TEST_CASE("pairing_slips: a search learns anew how soon records come") {
    Bench bench;
    bench.frame_after = milliseconds(60);
    const auto take = [&](Duration recorded_after) {
        Exposure one = bench.next();
        one.recorded = one.end_on_host + recorded_after;
        bench.pairing.add(one);
        bench.pairing.add(bench.frame(bench.next_id++, one));
    };
    const std::uint64_t base = bench.tick;
    for (const std::uint64_t at : pattern) {
        bench.tick = base + at - 1;
        take(milliseconds(45));
    }
    REQUIRE(bench.pairing.state() == State::locked);
    for (int i = 0; i < 8; ++i) take(milliseconds(45));
    bench.camera_ahead = bench.camera_ahead + seconds(40);
    bench.next_id += 500;
    for (int i = 0; i < 20 && bench.pairing.state() != State::searching; ++i) {
        bench.camera_ahead = bench.camera_ahead + milliseconds(15);
        bench.next_id += 7;
        take(milliseconds(45));
    }
    REQUIRE(bench.pairing.state() == State::searching);
    bench.decided = {};
    // The estimate of the board's clock has moved: none of these is odd.
    for (int i = 0; i < 2; ++i) take(milliseconds(2));
    take(milliseconds(45));
    for (const auto& pulse : bench.decided.pulses) CHECK(pulse.reason != EventReason::mismatch);
}

TEST_CASE("pairing_slips: after a step of the board's time a start is wanted without frames") {
    Bench bench;
    bench.lock();
    bench.pairing.start_requested(Start::pattern, bench.now);
    for (int i = 0; i < 3; ++i) {  // they seem to come before they are
        Exposure one = bench.next();
        one.start = one.start + seconds(3);
        one.end = one.end + seconds(3);
        one.earliest_on_host = one.end_on_host = one.end_on_host + seconds(3);
        bench.pairing.add(one);
    }
    CHECK(bench.pairing.state() == State::searching);
    // Once the one before is over.
    CHECK(bench.pairing.wanted_start(bench.now + seconds(2)) == Start::pattern);
}
