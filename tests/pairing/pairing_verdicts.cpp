// SPDX-License-Identifier: BSD-3-Clause
// How each frame is decided, and what is waited for until then.
#include <catch2/catch.hpp>
#include <vector>

#include "pairing_bench.hpp"

using namespace versavis;
using namespace versavis::test;

TEST_CASE("pairing_verdicts: exposures are kept for as long as their frames may come") {
    CHECK(longest_latest_arrival(period) == period * 992 - usual_exposure_wait);
    for (const auto& [latest, kept] :
         {std::pair{milliseconds(500), 128U}, {seconds(10), 237U}, {seconds(100), 1024U}}) {
        Limits limits = Bench::made();
        limits.latest_arrival = latest;
        Bench bench(limits);
        for (unsigned i = 0; i < kept; ++i) bench.pairing.add(bench.next());
        CHECK(bench.decided.pulses.empty());
        bench.pairing.add(bench.next());
        CHECK(bench.decided.pulses == std::vector<Decisions::Pulse>{{1, EventReason::unproved}});
    }
}

TEST_CASE("pairing_verdicts: a lock begins with its first frame, and gives up what was before") {
    Bench bench;
    for (int i = 0; i < 3; ++i) bench.pairing.add(bench.next());
    bench.next_id = 50;
    const std::uint64_t base = bench.tick;
    for (const std::uint64_t at : pattern) bench.take(base + at - bench.tick);
    CHECK(bench.decided.locks == std::vector<std::uint64_t>{4});
    CHECK(bench.decided.pulses == std::vector<Decisions::Pulse>{{1, EventReason::unproved},
                                                                {2, EventReason::unproved},
                                                                {3, EventReason::unproved}});
    CHECK(bench.decided.pairs.front() == std::pair<std::uint64_t, std::uint64_t>{50, 4});
}

TEST_CASE("pairing_verdicts: a search waits until no record can be missing") {
    for (const auto& [after, locked] :
         {std::pair{microseconds(37'500), false}, {microseconds(37'500) - nanoseconds(1), true}}) {
        Bench bench;
        Exposure last;
        for (int i = 0; i < 4; ++i) bench.take(pattern[i] - bench.tick);
        last = bench.next(pattern[4] - bench.tick);
        bench.pairing.add(last);
        Arrival frame = bench.frame(bench.next_id, last);
        frame.arrived = last.earliest_on_host + after;
        bench.pairing.add(frame);
        CHECK((bench.pairing.state() == State::locked) == locked);
    }
}

TEST_CASE("pairing_verdicts: a frame that was given up before its record came proves nothing") {
    Limits limits = Bench::made();
    limits.frames_held = 4;
    limits.latest_arrival = seconds(3);
    Bench bench(limits);
    // All records of one pattern, and none of the next, are there.
    for (const std::uint64_t at : pattern) bench.pairing.add(bench.next(at - bench.tick));
    const std::uint64_t base = bench.tick;
    for (const std::uint64_t at : pattern)
        bench.pairing.add(bench.frame(bench.next_id++, bench.next(base + at - bench.tick)));
    CHECK(bench.decided.locks.empty());
}

TEST_CASE("pairing_verdicts: no start is by frames that come sooner than any did, unless seen") {
    // The camera ignores just the triggers that its frames seem to be of a later pattern.
    constexpr std::uint64_t later = 15;  // periods
    constexpr std::uint64_t grid_points[] = {1, 2, 4, 5, 8, 10, 12, 15, 18, 19, 20};
    for (const auto& [kind, new_stream] : {std::pair{StampKind::trigger_edge, false},
                                           {StampKind::trigger_edge, true},
                                           {StampKind::measured_middle, false}}) {
        Limits limits = Bench::made();
        limits.latest_arrival = seconds(2);
        limits.frames_held = 20;
        Bench bench(limits);
        bench.frame_after = period * later + milliseconds(20);
        const auto add = [&, made = kind](std::uint64_t steps) {
            Exposure exposure = bench.next(steps);
            exposure.kind = made;
            bench.pairing.add(exposure);
            return exposure;
        };
        const auto send_pattern = [&](std::uint64_t gap) {
            const std::uint64_t base = bench.tick;
            std::vector<Exposure> exposures;
            for (const std::uint64_t at : grid_points)
                exposures.push_back(add(base + at * gap - bench.tick));
            for (std::uint64_t i = 0; i <= later; ++i) add(1);
            return exposures;
        };
        for (const Exposure& exposure : send_pattern(2))
            bench.pairing.add(bench.frame(bench.next_id++, exposure));
        REQUIRE(bench.decided.locks.size() == 1);
        bench.pairing.reset();
        if (new_stream) bench.pairing.set_limits(limits);
        for (std::uint64_t i = 0; i < 20; ++i) add(1);
        const std::vector<Exposure> exposures = send_pattern(1);
        for (std::size_t i = 0; i < 8; ++i) {
            Arrival frame = bench.frame(bench.next_id++, exposures[i]);
            frame.arrived = exposures[i].end_on_host + milliseconds(20);
            bench.pairing.add(frame);
        }
        const bool held_against = kind == StampKind::trigger_edge && !new_stream;
        INFO("kind " << static_cast<int>(kind) << ", new stream " << new_stream);
        CHECK(bench.decided.locks.size() == (held_against ? 1 : 2));
    }
}

TEST_CASE("pairing_verdicts: three frames a second apart prove a slow start") {
    for (const bool has_clock : {true, false}) {
        Limits limits = Bench::made();
        limits.camera_clock = has_clock;
        Bench bench(limits);
        bench.pairing.start_requested(Start::slow, HostTime{});
        for (int i = 0; i < 3; ++i) {
            CHECK(bench.pairing.state() == State::searching);
            bench.take(20);
        }
        CHECK(bench.pairing.state() == State::locked);
        CHECK(bench.decided.pairs.size() == 3);
        CHECK(bench.pairing.wanted_start(bench.now) == Start::steady);
        bench.pairing.start_requested(Start::steady, bench.now);
        CHECK_FALSE(bench.pairing.wanted_start(bench.now));
    }
    Bench pattern_start;
    pattern_start.pairing.start_requested(Start::pattern, HostTime{});
    for (int i = 0; i < 8; ++i) pattern_start.take(20);
    CHECK(pattern_start.pairing.state() == State::searching);
}

TEST_CASE("pairing_verdicts: a frame of a silent exposure is ignored by the camera, it is said") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    Exposure silent = bench.next();
    silent.exposed = false;
    bench.pairing.add(silent);
    bench.pairing.add(bench.frame(bench.next_id++, silent));
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::trigger_ignored);
    CHECK(bench.decided.frames[0].guess == silent.trigger);
    CHECK(bench.decided.slips.empty());
}

TEST_CASE("pairing_verdicts: a record that was lost holds up nothing behind its frame") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure lost = bench.next();
    const Exposure next = bench.next();
    bench.pairing.add(bench.frame(bench.next_id++, lost));
    bench.pairing.add(bench.frame(bench.next_id++, next));
    CHECK(bench.decided.frames.empty());
    CHECK(bench.decided.pairs.empty());
    bench.pairing.add(next);
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::exposure_missing);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_verdicts: without any exposure left, a frame waits for its record") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    bench.pairing.advance(bench.now + seconds(2));
    const Exposure one = bench.next(60);
    bench.pairing.add(bench.frame(bench.next_id++, one));
    CHECK(bench.decided.frames.empty());
    bench.pairing.add(one);
    CHECK(bench.decided.pairs.size() == 1);
}

TEST_CASE("pairing_verdicts: a frame is early that comes two thirds of a period before any did") {
    for (const auto& [sooner_ns, early] : {std::pair{33'333'333, false}, {33'333'334, true}}) {
        Bench bench;
        bench.frame_after = milliseconds(60);
        bench.lock();
        bench.decided = {};
        const Exposure one = bench.next();
        bench.pairing.add(one);
        Arrival frame = bench.frame(bench.next_id++, one);
        frame.arrived = frame.arrived - nanoseconds(sooner_ns);
        bench.pairing.add(frame);
        CHECK(bench.decided.slips.size() == (early ? 1 : 0));
        CHECK(bench.decided.pairs.size() == (early ? 0 : 1));
    }
}

TEST_CASE("pairing_verdicts: out of order is up to 16 ids back, and as long as frames may take") {
    Limits limits = Bench::made();
    limits.latest_arrival = seconds(2);
    for (const auto& [back, behind, disorder] :
         {std::tuple{16U, 16, true}, {17U, 16, false}, {1U, 1, true}, {2U, 41, false}}) {
        Bench bench(limits);
        bench.lock();
        for (int i = 0; i < 40; ++i) bench.take();
        bench.decided = {};
        const Exposure newest = Bench::exposure(bench.next_trigger - 1, bench.tick);
        Arrival frame = bench.frame(bench.next_id - 1 - back, newest);
        frame.camera_time = frame.camera_time - period * behind;
        bench.pairing.add(frame);
        if (disorder) {
            REQUIRE(bench.decided.frames.size() == 1);
            CHECK(bench.decided.frames[0].reason == EventReason::out_of_order);
        } else {
            for (const auto& one : bench.decided.frames)
                CHECK(one.reason != EventReason::out_of_order);
        }
        CHECK(bench.decided.slips.size() == (disorder ? 0 : 1));
    }
}

TEST_CASE("pairing_verdicts: while it checks, a frame waits for records that may explain it") {
    Bench bench;
    bench.lock();
    // The ids jump: the first frame is a slip.
    bench.next_id += 3;
    bench.take();
    REQUIRE(bench.pairing.state() == State::checking);
    bench.decided = {};
    const Exposure one = bench.next();
    bench.pairing.add(bench.frame(bench.next_id++, one));
    CHECK(bench.decided.frames.empty());
    CHECK(bench.decided.pairs.empty());
    bench.pairing.add(one);
    bench.take();
    CHECK(bench.pairing.state() == State::locked);
    // Clock and arrival agreed on three frames: the third is published, the others were not.
    CHECK(bench.decided.pairs.size() == 1);
    CHECK(bench.decided.locks.size() == 1);
    bench.take();
    CHECK(bench.decided.pairs.size() == 2);
}

TEST_CASE("pairing_verdicts: each slip is given as long as the one before") {
    Bench bench;
    bench.lock();
    for (int round = 0; round < 3; ++round) {
        bench.decided = {};
        bench.next_id += 3;
        for (int i = 0; i < 3; ++i) {
            CHECK(bench.decided.pairs.empty());
            bench.take();
        }
        CHECK(bench.decided.pairs.size() == 1);
        CHECK(bench.decided.slips.size() == 1);
        for (int i = 0; i < 4; ++i) bench.take();
        CHECK(bench.decided.pairs.size() == 5);
    }
}

TEST_CASE("pairing_verdicts: a search is given up for after five frames, and a tenth of a second") {
    for (const auto& [apart, frames] :
         {std::pair{milliseconds(25), 5U}, {milliseconds(24), 6U}, {milliseconds(50), 5U}}) {
        Bench bench;
        bench.lock();
        bench.decided = {};
        bench.next_id += 300;
        // Stamps of no exposure, ids of none either, and arrivals between those that are usual.
        const Exposure newest = Bench::exposure(bench.next_trigger - 1, bench.tick);
        for (int i = 0; i < 40; ++i) bench.pairing.add(bench.next());
        for (int i = 1; i < 30 && bench.pairing.state() != State::searching; ++i) {
            Arrival arrival = bench.frame(bench.next_id, newest);
            bench.next_id += 7;
            arrival.camera_time = arrival.camera_time - seconds(30) * i;
            arrival.arrived = arrival.arrived + apart * i;
            bench.pairing.add(arrival);
        }
        CHECK(bench.pairing.state() == State::searching);
        CHECK(bench.decided.frames.size() == frames);
    }
}

TEST_CASE(
    "pairing_verdicts: a camera that steps its clock is followed when ids and arrival agree") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    bench.camera_ahead = bench.camera_ahead + seconds(11);
    for (int i = 0; i < 3; ++i) bench.take();
    CHECK(bench.decided.slips.size() == 1);
    CHECK(bench.decided.locks.size() == 1);
    CHECK(bench.decided.pairs.size() == 1);
    CHECK(bench.decided.frames.size() == 2);
    for (int i = 0; i < 5; ++i) bench.take();
    CHECK(bench.decided.pairs.size() == 6);
    CHECK(bench.decided.slips.size() == 1);
}
