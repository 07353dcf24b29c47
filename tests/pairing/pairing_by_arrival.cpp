// SPDX-License-Identifier: BSD-3-Clause
// Cameras without a clock: ids and arrivals alone show what a frame is of.
#include <catch2/catch.hpp>

#include "pairing_bench.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

Limits without_clock() {
    Limits limits = Bench::made();
    limits.camera_clock = false;
    return limits;
}

}  // namespace

TEST_CASE("pairing_by_arrival: a frame waits for its record, and is no slip") {
    Bench bench(without_clock());
    bench.lock_slowly();
    const Exposure one = bench.next();
    bench.pairing.add(bench.frame(bench.next_id, one));
    CHECK(bench.decided.slips.empty());
    CHECK(bench.decided.frames.empty());
    bench.pairing.add(one);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_by_arrival: a frame that comes once more is out of order, however late") {
    for (const int periods : {0, 1, 3}) {
        Bench bench(without_clock());
        bench.lock_slowly();
        const Exposure one = Bench::exposure(bench.next_trigger - 1, bench.tick);
        for (int i = 0; i < periods; ++i) bench.pairing.add(bench.next());
        Arrival again = bench.frame(bench.next_id - 1, one);
        again.arrived = again.arrived + period * periods;
        bench.pairing.add(again);
        REQUIRE(bench.decided.frames.size() == 1);
        CHECK(bench.decided.frames[0].reason == EventReason::out_of_order);
        CHECK(bench.decided.slips.empty());
    }
}

TEST_CASE("pairing_by_arrival: ids must count each trigger, for nothing else would show it") {
    Bench bench(without_clock());
    bench.lock_slowly();
    Exposure silent = bench.next();
    silent.exposed = false;
    bench.pairing.add(silent);
    bench.take();  // its id counts what was taken
    CHECK(bench.decided.pairs.empty());
    CHECK(bench.decided.slips.size() == 1);
}

TEST_CASE("pairing_by_arrival: one late frame says little of the next") {
    Bench bench(without_clock());
    bench.lock_slowly();
    bench.frame_after = milliseconds(36);
    bench.take();
    bench.frame_after = milliseconds(6);
    bench.take();
    CHECK(bench.decided.pairs.size() == 2);
    CHECK(bench.decided.slips.empty());
}

TEST_CASE("pairing_by_arrival: when frames come too irregularly, none is published") {
    Bench bench(without_clock());
    bench.lock_slowly();
    for (int i = 0; i < 200 && bench.decided.slips.empty(); ++i) {
        bench.frame_after = milliseconds(i % 2 == 0 ? 30 : 10);
        bench.take();
    }
    CHECK(bench.decided.slips.size() == 1);
}

TEST_CASE("pairing_by_arrival: a counter that began anew is recognised by more than 16 ids") {
    for (const auto& [jump, followed] :
         {std::pair{3U, false}, {16U, false}, {17U, true}, {1000U, true}}) {
        Bench bench(without_clock());
        bench.lock_slowly();
        bench.next_id += jump;
        int frames = 0;
        do {
            bench.take();
            ++frames;
        } while (bench.pairing.state() == State::checking);
        CHECK(bench.decided.slips.size() == 1);
        CHECK((bench.pairing.state() == State::locked) == followed);
        CHECK(bench.decided.pairs.size() == (followed ? 1 : 0));
        // 0.3 s are waited for before it is given up.
        CHECK(frames == (followed ? 3 : 7));
    }
}

TEST_CASE("pairing_by_arrival: a single frame that agrees ends no check, three do") {
    Bench bench(without_clock());
    bench.lock_slowly();
    bench.next_id += 3;
    bench.take();
    bench.next_id -= 3;
    CHECK(bench.decided.slips.size() == 1);
    for (int i = 0; i < 2; ++i) {
        bench.take();
        CHECK(bench.pairing.state() == State::checking);
    }
    bench.take();
    CHECK(bench.pairing.state() == State::locked);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_by_arrival: frames without a time end the search by times") {
    Bench bench;
    for (int i = 0; i < 2; ++i) bench.take();
    CHECK(bench.pairing.first_start() == Start::pattern);
    const Exposure one = bench.next();
    bench.pairing.add(one);
    Arrival frame = bench.frame(bench.next_id++, one);
    frame.camera_time = {};
    bench.pairing.add(frame);
    REQUIRE(bench.decided.frames.size() == 2);
    CHECK(bench.decided.frames[0].reason == EventReason::unproved);
    CHECK(bench.pairing.first_start() == Start::slow);
}
