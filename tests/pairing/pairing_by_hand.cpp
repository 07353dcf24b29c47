// SPDX-License-Identifier: BSD-3-Clause
// What comes back of frames and triggers, when, and for which reason.
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "pairing_bench.hpp"

using namespace versavis;
using namespace versavis::test;

TEST_CASE("pairing_by_hand: each state has its name") {
    CHECK(std::string(to_string(State::searching)) == "searching");
    CHECK(std::string(to_string(State::checking)) == "checking");
    CHECK(std::string(to_string(State::locked)) == "locked");
    CHECK(std::string(to_string(static_cast<State>(9))) == "unknown");
    CHECK(static_cast<int>(Start::pattern) == 1);
    CHECK(static_cast<int>(Start::slow) == 2);
    CHECK(static_cast<int>(Start::steady) == 3);
}

TEST_CASE("pairing_by_hand: a camera that takes all is paired from its first frame on") {
    Bench bench;
    bench.lock();
    REQUIRE(bench.decided.pairs.size() == 22);
    for (const auto& [id, trigger] : bench.decided.pairs) CHECK(id == trigger);
    CHECK(bench.decided.locks == std::vector<std::uint64_t>{1});
    CHECK(bench.decided.frames.empty());
    CHECK(bench.decided.pulses.empty());
    CHECK(bench.decided.slips.empty());
}

TEST_CASE("pairing_by_hand: a reset gives all back, and what was known of the life before") {
    Bench bench;
    bench.lock();
    for (const std::uint64_t id : {23, 24, 25})
        bench.pairing.add(Shortfall{id, EventReason::frame_incomplete});
    const Exposure waits = bench.next();
    bench.pairing.add(waits);
    const Exposure late = bench.next();
    bench.pairing.add(bench.frame(24, late));  // its record has not come
    bench.decided = {};
    bench.pairing.reset();
    CHECK(bench.pairing.state() == State::searching);
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].id == 24);
    CHECK(bench.decided.frames[0].reason == EventReason::reset);
    CHECK(bench.decided.pulses == std::vector<Decisions::Pulse>{{23, EventReason::reset}});
    CHECK_FALSE(bench.pairing.due(bench.now + seconds(60)));
    // The next life counts, and stamps, in its own way.
    bench.decided = {};
    bench.tick = 0;
    bench.next_trigger = 1;
    bench.next_id = 1'000;
    bench.camera_ahead = seconds(90);
    bench.lock();
    CHECK(bench.decided.pairs.size() == 22);
    CHECK(bench.decided.frames.empty());
    CHECK(bench.decided.slips.empty());
}

TEST_CASE("pairing_by_hand: limits of a new stream replace those of the old one") {
    Bench bench;
    CHECK(bench.pairing.first_start() == Start::pattern);
    CHECK(bench.pairing.stamped() == Instant::start);
    Limits limits = Bench::made();
    limits.camera_clock = false;
    limits.stamped = Instant::end;
    bench.pairing.set_limits(limits);
    CHECK(bench.pairing.first_start() == Start::slow);
    CHECK(bench.pairing.stamped() == Instant::end);
    // A grid of four times the period: by the one before, each record would be off, and frames
    // that come 100 ms after the exposures would wait for more records. Two frames may wait.
    limits = Bench::made();
    limits.period = period * 4;
    limits.frames_held = 5;
    bench.pairing.set_limits(limits);
    bench.frame_after = milliseconds(100);
    for (std::uint64_t i = 0; i < 5; ++i) {
        Exposure one = Bench::exposure(i + 1, pattern[i] * 4);
        one.tick = pattern[i];
        bench.pairing.add(one);
        bench.pairing.add(bench.frame(i + 1, one));
    }
    CHECK(bench.decided.pulses.empty());
    CHECK(bench.decided.frames.empty());
    CHECK(bench.pairing.state() == State::locked);
    bench.pairing.reset();
    bench.decided = {};
    for (std::uint64_t i = 1; i <= 6; ++i) bench.pairing.add(bench.frame(i, Bench::exposure(i, i)));
    CHECK(bench.decided.frames.size() == 1);
}

TEST_CASE(
    "pairing_by_hand: after a reset the first record counts, and old losses explain nothing") {
    Bench bench;
    bench.lock();
    for (int i = 0; i < 6; ++i) bench.pairing.start_requested(Start::pattern, bench.now);
    for (std::uint64_t id = 1; id < 30; ++id)
        bench.pairing.add(Shortfall{id, EventReason::no_buffer});
    bench.pairing.reset();
    bench.decided = {};
    bench.next_trigger = bench.next_id = 1;
    bench.tick = 0;
    SECTION("records") {
        bench.pairing.add(Bench::exposure(1, 1));
        Exposure lie = Bench::exposure(2, 2);
        lie.start = lie.start + seconds(1);
        bench.pairing.add(lie);
        bench.pairing.add(Bench::exposure(3, 3));
        CHECK(bench.decided.pulses == std::vector<Decisions::Pulse>{{2, EventReason::mismatch}});
    }
    SECTION("losses") {
        bench.lock();
        bench.pairing.add(bench.next());
        ++bench.next_id;
        bench.take();
        CHECK(bench.decided.pulses ==
              std::vector<Decisions::Pulse>{{23, EventReason::frame_missing}});
    }
    SECTION("pauses between starts") {
        for (std::uint64_t i = 1; i <= 5; ++i)
            bench.pairing.add(bench.frame(i, Bench::exposure(i, i)));
        const Duration carried_out = seconds(1) + usual_latest_arrival;
        CHECK_FALSE(bench.pairing.wanted_start(bench.now + carried_out));
        CHECK(bench.pairing.wanted_start(bench.now + carried_out + nanoseconds(1)));
    }
}

TEST_CASE("pairing_by_hand: a lock ends the pauses between starts") {
    Bench bench;
    for (int i = 0; i < 6; ++i) bench.pairing.start_requested(Start::pattern, bench.now);
    const HostTime asked = bench.now;
    bench.lock();
    for (int i = 0; i < 3; ++i) {  // the board's time steps: all is searched anew
        Exposure one = bench.next();
        one.earliest_on_host = one.earliest_on_host + seconds(3);
        bench.pairing.add(one);
    }
    REQUIRE(bench.pairing.state() == State::searching);
    const Duration carried_out = seconds(1) + usual_latest_arrival;
    CHECK(bench.pairing.wanted_start(asked + carried_out + nanoseconds(1)));
}

TEST_CASE("pairing_by_hand: a first frame that was late has no exposure to guess") {
    Bench bench;
    bench.camera_ahead = {};  // the camera's clock is the board's
    bench.lock();
    bench.pairing.reset();
    bench.decided = {};
    const std::uint64_t base = bench.tick;
    for (const std::uint64_t at : pattern) {
        bench.frame_after = milliseconds(at == 1 ? 55 : 20);
        bench.take(base + at - bench.tick);
    }
    REQUIRE(bench.pairing.state() == State::locked);
    REQUIRE_FALSE(bench.decided.frames.empty());
    CHECK(bench.decided.frames[0].id == 23);
    CHECK(bench.decided.frames[0].guess == 0);
}

TEST_CASE("pairing_by_hand: ids that leave out ignored triggers explain the lost ones as well") {
    Bench bench;
    bench.lock();
    const auto ignore = [&] {
        Exposure silent = bench.next();
        silent.exposed = false;
        bench.pairing.add(silent);
        return silent.trigger;
    };
    const auto lose = [&](std::uint64_t id) {
        bench.decided = {};
        const std::uint64_t ignored = ignore();
        const Exposure lost = bench.next();
        bench.pairing.add(lost);
        ++bench.next_id;
        bench.pairing.add(Shortfall{id, EventReason::no_buffer});
        bench.take();
        REQUIRE(bench.decided.pulses.size() == 2);
        CHECK(bench.decided.pulses[0] == Decisions::Pulse{ignored, EventReason::trigger_ignored});
        return bench.decided.pulses[1].reason;
    };
    CHECK(lose(bench.next_id) == EventReason::no_buffer);
    CHECK(lose(bench.next_id + 1) == EventReason::no_buffer);  // it may count them, too
    CHECK(lose(bench.next_id - 1) == EventReason::frame_missing);
}

TEST_CASE("pairing_by_hand: a trigger without frame says what became of the frame") {
    Bench bench;
    bench.lock();
    const auto lost = [&](const std::vector<Shortfall>& shortfalls, unsigned count) {
        bench.decided = {};
        for (unsigned i = 0; i < count; ++i) {
            bench.pairing.add(bench.next());
            ++bench.next_id;
        }
        for (const Shortfall& shortfall : shortfalls) bench.pairing.add(shortfall);
        bench.take();
        REQUIRE(bench.decided.pairs.size() == 1);
        std::vector<EventReason> reasons;
        for (const auto& pulse : bench.decided.pulses) reasons.push_back(pulse.reason);
        return reasons;
    };
    using Reasons = std::vector<EventReason>;
    CHECK(lost({}, 1) == Reasons{EventReason::frame_missing});
    CHECK(lost({{bench.next_id, EventReason::wrong_size}}, 1) == Reasons{EventReason::wrong_size});
    CHECK(lost({{0, EventReason::no_buffer}}, 1) == Reasons{EventReason::no_buffer});
    // Of two, each has its own; a number that none has explains none.
    CHECK(lost({{bench.next_id + 1, EventReason::no_buffer}}, 2) ==
          Reasons{EventReason::frame_missing, EventReason::no_buffer});
    CHECK(lost({{bench.next_id + 9, EventReason::no_buffer}}, 1) ==
          Reasons{EventReason::frame_missing});
}

TEST_CASE("pairing_by_hand: of frames known to be lost, the newest 32 are remembered") {
    for (const unsigned later : {31U, 32U}) {
        Bench bench;
        bench.lock();
        bench.decided = {};
        bench.pairing.add(Shortfall{bench.next_id, EventReason::wrong_size});
        for (unsigned i = 0; i < later; ++i)
            bench.pairing.add(Shortfall{bench.next_id + 1000 + i, EventReason::no_buffer});
        bench.pairing.add(bench.next());
        ++bench.next_id;
        bench.take();
        REQUIRE(bench.decided.pulses.size() == 1);
        CHECK(bench.decided.pulses[0].reason ==
              (later == 31 ? EventReason::wrong_size : EventReason::frame_missing));
    }
}

TEST_CASE("pairing_by_hand: frames that wait are bounded, and the oldest goes first") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    std::vector<Exposure> held_up;
    for (std::uint64_t i = 0; i < 9; ++i) {
        held_up.push_back(bench.next());
        bench.pairing.add(bench.frame(bench.next_id++, held_up.back()));
        CHECK(bench.decided.frames.size() == (i < 8 ? 0 : 1));
    }
    CHECK(bench.decided.frames[0].id == 23);
    CHECK(bench.decided.frames[0].reason == EventReason::exposure_missing);
    CHECK(bench.pairing.state() == State::locked);
    // While nothing is known, it is unproved.
    Bench other;
    for (std::uint64_t i = 1; i <= 9; ++i) other.pairing.add(other.frame(i, Bench::exposure(i, i)));
    REQUIRE(other.decided.frames.size() == 1);
    CHECK(other.decided.frames[0].reason == EventReason::unproved);
    CHECK(other.decided.frames[0].guess == 0);
}

TEST_CASE("pairing_by_hand: a frame waits for its record as long as the limits say") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Arrival waits = bench.frame(bench.next_id++, bench.next());
    bench.pairing.add(waits);
    const HostTime until = waits.arrived + usual_exposure_wait;
    CHECK_FALSE(bench.pairing.due(until));
    bench.pairing.advance(until);
    CHECK(bench.decided.frames.empty());
    CHECK(bench.pairing.due(until + nanoseconds(1)));
    bench.pairing.advance(until + nanoseconds(1));
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::exposure_missing);
}

TEST_CASE("pairing_by_hand: while it searches, frames wait for ten seconds and ten periods") {
    Bench bench;
    const Arrival waits = bench.frame(1, Bench::exposure(1, 1));
    bench.pairing.add(waits);
    const HostTime until = waits.arrived + seconds(10) + period * 10;
    CHECK_FALSE(bench.pairing.due(until));
    CHECK(bench.pairing.due(until + nanoseconds(1)));
    bench.pairing.advance(until + nanoseconds(1));
    REQUIRE(bench.decided.frames.size() == 1);
    CHECK(bench.decided.frames[0].reason == EventReason::unproved);
}

TEST_CASE(
    "pairing_by_hand: a trigger waits for its frame, and knows whether the camera is silent") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure waits = bench.next();
    bench.pairing.add(waits);
    const Duration patience = usual_latest_arrival + usual_exposure_wait;
    const HostTime until = waits.earliest_on_host + patience;
    bench.pairing.advance(until);
    CHECK(bench.decided.pulses.empty());
    CHECK(bench.pairing.due(until + nanoseconds(1)));
    SECTION("nothing came since") {
        bench.pairing.advance(until + nanoseconds(1));
        CHECK(bench.decided.pulses ==
              std::vector<Decisions::Pulse>{{waits.trigger, EventReason::camera_silent}});
    }
    SECTION("a frame came, of another exposure") {
        Arrival other = bench.frame(bench.next_id + 1, bench.next());
        other.arrived = until - patience + milliseconds(1);
        bench.pairing.add(other);
        bench.pairing.advance(until + nanoseconds(1));
        REQUIRE_FALSE(bench.decided.pulses.empty());
        CHECK(bench.decided.pulses[0] ==
              Decisions::Pulse{waits.trigger, EventReason::frame_missing});
    }
}

TEST_CASE("pairing_by_hand: a search keeps 32 exposures, however old") {
    Bench bench;
    for (int i = 0; i < 33; ++i) bench.pairing.add(bench.next());
    const HostTime later = Bench::exposure(33, 33).end_on_host + seconds(60);
    CHECK(bench.pairing.due(later));
    bench.pairing.advance(later);
    REQUIRE(bench.decided.pulses.size() == 1);
    CHECK(bench.decided.pulses[0].trigger == 1);
    CHECK(bench.decided.pulses[0].reason == EventReason::unproved);
    CHECK_FALSE(bench.pairing.due(later + seconds(60)));
}

TEST_CASE("pairing_by_hand: a record that no exposure can have is refused, and changes nothing") {
    Bench bench;
    bench.lock();
    const Exposure newest = bench.next();
    bench.pairing.add(newest);
    bench.decided = {};
    const auto with = [&](auto change) {
        Exposure lie = Bench::exposure(newest.trigger + 1, newest.tick + 1);
        change(lie);
        return lie;
    };
    const Exposure lies[] = {
        newest,
        with([&](Exposure& lie) { lie.trigger = newest.trigger; }),
        with([&](Exposure& lie) { lie.start = newest.start; }),
        with([&](Exposure& lie) { lie.end = lie.start - nanoseconds(1); }),
    };
    for (const Exposure& lie : lies) {
        bench.pairing.add(lie);
        CHECK(bench.decided.pulses ==
              std::vector<Decisions::Pulse>{{lie.trigger, EventReason::mismatch}});
        bench.decided = {};
    }
    bench.pairing.add(bench.frame(bench.next_id++, newest));
    bench.take();
    CHECK(bench.pairing.state() == State::locked);
    CHECK(bench.decided.pairs.size() == 2);
}

TEST_CASE("pairing_by_hand: three records in a row that come too early are a step") {
    Bench bench;
    bench.lock();
    const Exposure waits = bench.next();
    bench.pairing.add(waits);
    bench.decided = {};
    const auto early = [&] {
        Exposure one = bench.next();
        one.earliest_on_host = one.end_on_host = one.end_on_host + seconds(3);
        bench.pairing.add(one);
        return Decisions::Pulse{one.trigger, EventReason::mismatch};
    };
    std::vector<Decisions::Pulse> expected{early(), early()};
    bench.pairing.add(bench.next());  // one that does not: it was no step
    expected.push_back(early());
    expected.push_back(early());
    CHECK(bench.pairing.state() == State::locked);
    CHECK(bench.decided.pulses == expected);
    bench.decided = {};
    const Decisions::Pulse third = early();
    CHECK(bench.pairing.state() == State::searching);
    REQUIRE(bench.decided.pulses.size() == 3);
    CHECK(bench.decided.pulses[0] == third);
    CHECK(bench.decided.pulses[1] == Decisions::Pulse{waits.trigger, EventReason::reset});
    CHECK(bench.pairing.wanted_start(bench.now + seconds(60)) == Start::pattern);
}

TEST_CASE(
    "pairing_by_hand: starts that find nothing are asked for less and less, each third slow") {
    Bench bench;
    HostTime now = HostTime{} + host_ahead;
    std::uint64_t id = 1;
    const auto wait_for_start = [&] {
        Duration waited;
        const HostTime begun = now;
        for (int i = 0; i < 4000; ++i) {
            Arrival arrival;
            arrival.block_id = id++;
            arrival.arrived = now;
            arrival.camera_time = CameraTime{now.ns} + bench.camera_ahead;
            bench.pairing.add(arrival);
            if (bench.pairing.wanted_start(now)) break;
            now = now + milliseconds(10);
        }
        waited = now - begun;
        return waited;
    };
    const Duration quick = seconds(1) + usual_latest_arrival;
    const Duration slow = seconds(6) + usual_latest_arrival;
    const auto within = [](Duration waited, Duration expected) {
        CHECK(waited > expected - milliseconds(10));
        CHECK(waited <= expected + milliseconds(20));
    };
    CHECK(wait_for_start() <= milliseconds(200));
    CHECK(bench.pairing.wanted_start(now) == Start::pattern);
    bench.pairing.start_requested(Start::pattern, now);
    CHECK_FALSE(bench.pairing.wanted_start(now + seconds(1000)));  // no frame since
    within(wait_for_start(), quick);
    CHECK(bench.pairing.wanted_start(now) == Start::pattern);
    bench.pairing.start_requested(Start::pattern, now);
    within(wait_for_start(), quick);
    CHECK(bench.pairing.wanted_start(now) == Start::slow);
    bench.pairing.start_requested(Start::slow, now);
    within(wait_for_start(), slow);
    CHECK(bench.pairing.wanted_start(now) == Start::pattern);
    bench.pairing.start_requested(Start::pattern, now);
    within(wait_for_start(), quick);
    bench.pairing.start_requested(Start::pattern, now);
    within(wait_for_start(), quick * 2);
    CHECK(bench.pairing.wanted_start(now) == Start::slow);
    bench.pairing.start_requested(Start::slow, now);
    within(wait_for_start(), slow * 3);
}

TEST_CASE(
    "pairing_by_hand: frames that come once more, or after newer ones, are no loss of others") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure first = bench.next();
    const Exposure second = bench.next();
    bench.pairing.add(first);
    bench.pairing.add(second);
    bench.pairing.add(bench.frame(bench.next_id + 1, second));
    bench.pairing.add(bench.frame(bench.next_id + 1, second));
    bench.pairing.add(bench.frame(bench.next_id, first));
    CHECK(bench.decided.pairs.size() == 1);
    REQUIRE(bench.decided.frames.size() == 2);
    for (const auto& frame : bench.decided.frames) CHECK(frame.reason == EventReason::out_of_order);
    CHECK(bench.decided.slips.empty());
    // They explain no trigger that has no frame.
    bench.next_id += 2;
    bench.pairing.add(bench.next());
    ++bench.next_id;
    bench.take();
    CHECK(bench.decided.pulses.back().reason == EventReason::frame_missing);
}

TEST_CASE("pairing_by_hand: a silent exposure line shows that a trigger was ignored") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    Exposure silent = bench.next();
    silent.exposed = false;
    bench.pairing.add(silent);
    bench.take();
    CHECK(bench.decided.pairs.size() == 1);
    CHECK(bench.decided.pulses ==
          std::vector<Decisions::Pulse>{{silent.trigger, EventReason::trigger_ignored}});
}

TEST_CASE(
    "pairing_by_hand: frames of another stamp than any exposure's are a slip, then a search") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    // The clock jumps by 2.4 periods and the ids by 300: nothing is left to go by.
    bench.next_id += 300;
    for (int i = 0; i < 30 && bench.pairing.state() != State::searching; ++i) {
        const Exposure one = bench.next();
        bench.pairing.add(one);
        Arrival arrival = bench.frame(bench.next_id, one);
        bench.next_id += 3;
        arrival.camera_time = arrival.camera_time + milliseconds(120) * (i + 1);
        bench.pairing.add(arrival);
    }
    CHECK(bench.pairing.state() == State::searching);
    CHECK(bench.decided.pairs.empty());
    CHECK(bench.decided.slips.size() == 1);
    REQUIRE_FALSE(bench.decided.frames.empty());
    CHECK(bench.decided.frames.size() == 5);
    for (std::size_t i = 0; i + 1 < bench.decided.frames.size(); ++i)
        CHECK(bench.decided.frames[i].reason == EventReason::unproved);
    CHECK(bench.decided.frames.back().reason == EventReason::mismatch);
}

TEST_CASE("pairing_by_hand: what was given up explains the trigger whose record comes at last") {
    Bench bench;
    bench.lock();
    bench.decided = {};
    const Exposure late = bench.next();
    const Arrival frame = bench.frame(bench.next_id++, late);
    bench.pairing.add(frame);
    bench.pairing.advance(frame.arrived + usual_exposure_wait + nanoseconds(1));
    REQUIRE(bench.decided.frames.size() == 1);
    bench.pairing.add(late);
    bench.take();
    CHECK(bench.decided.pulses ==
          std::vector<Decisions::Pulse>{{late.trigger, EventReason::exposure_missing}});
}

TEST_CASE("pairing_by_hand: a start is wanted once five frames came that prove nothing") {
    Bench bench;
    const auto frames_until_wanted = [&] {
        for (std::uint64_t i = 1; i < 100; ++i) {
            CHECK_FALSE(bench.pairing.wanted_start(HostTime{} + seconds(10'000)));
            bench.pairing.add(bench.frame(i, Bench::exposure(i, i)));
            if (bench.pairing.wanted_start(HostTime{} + seconds(10'000))) return i;
        }
        return std::uint64_t{0};
    };
    CHECK(frames_until_wanted() == 5);
    bench.pairing.reset();
    CHECK(frames_until_wanted() == 5);
    bench.pairing.start_requested(Start::pattern, HostTime{});
    CHECK(frames_until_wanted() == 5);
}
