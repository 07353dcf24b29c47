// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/pairing.hpp"

#include <catch2/catch.hpp>

#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using pairing::Instant;
using pairing::State;

namespace {

WorldSettings world(std::uint64_t seed = 1) {
    WorldSettings settings;
    settings.seed = seed;
    settings.late_frames = 0;
    settings.pulses = 200;
    return settings;
}

WorldSettings with(FaultKind kind, std::uint64_t at = 80) {
    WorldSettings settings = world();
    settings.faults[at] = kind;
    return settings;
}

/// What every world must show whatever fails in it.
Verdict run(const WorldSettings& settings) {
    const Verdict verdict = run_world(settings);
    CHECK(verdict.wrong == 0);
    CHECK(verdict.final_state == State::locked);
    return verdict;
}

}  // namespace

TEST_CASE(
    "pairing: a clean start publishes every frame, the first ones within half a second at 20 Hz") {
    WorldSettings settings = world();
    settings.rate_hz = GENERATE(5.0, 20.0, 155.0);
    settings.clock = GENERATE(WorldClock::good, WorldClock::drifting);
    settings.first_id = GENERATE(1U, 4711U);
    const Verdict verdict = run(settings);
    CHECK(verdict.published == verdict.frames);
    CHECK(verdict.locks == 1);
    CHECK(verdict.starts == 0);
    CHECK(static_cast<double>(verdict.first_published.ns) * 1e-9 * settings.rate_hz < 10);
}

TEST_CASE("pairing: a camera without a clock is started slowly, then paired by ids and arrival") {
    WorldSettings settings = world();
    settings.clock = WorldClock::absent;
    settings.clock_known_absent = GENERATE(true, false);
    const Verdict verdict = run(settings);
    // It is found out from the first frames, which are lost then.
    CHECK(verdict.withheld <= (settings.clock_known_absent ? 0U : 20U));
    CHECK(verdict.slips == 0);
    CHECK(verdict.first_published < seconds(settings.clock_known_absent ? 3 : 6));
}

TEST_CASE(
    "pairing: lost frames leave their triggers unpaired, with the reason, and shift nothing") {
    Verdict verdict = run(with(FaultKind::frame_lost));
    CHECK(verdict.exposure_reasons[EventReason::frame_missing] == 1);
    for (const FaultKind kind : {FaultKind::last_packet_lost, FaultKind::leader_lost}) {
        verdict = run(with(kind));
        CHECK(verdict.exposure_reasons[EventReason::frame_incomplete] == 1);
        CHECK(verdict.withheld == 0);
        CHECK(verdict.slips == 0);
    }
}

TEST_CASE("pairing: an ignored trigger is known from the silent exposure line") {
    WorldSettings settings = with(FaultKind::trigger_ignored);
    settings.faults[1] = settings.faults[81] = FaultKind::trigger_ignored;
    settings.ids_count_ignored = GENERATE(false, true);
    Verdict verdict = run(settings);
    CHECK(verdict.slips == 0);
    CHECK(verdict.withheld == 0);
    CHECK(verdict.exposure_reasons[EventReason::trigger_ignored] == 3);
}

TEST_CASE(
    "pairing: without an exposure line an ignored trigger is a slip, found at once and repaired") {
    WorldSettings settings = with(FaultKind::trigger_ignored);
    settings.strobe = false;
    const Verdict verdict = run(settings);
    CHECK(verdict.slips == 1);
    CHECK(verdict.withheld == 2);
    CHECK(verdict.starts == 0);
}

TEST_CASE("pairing: a lost exposure record costs its frame only") {
    Verdict verdict = run(with(FaultKind::record_lost));
    CHECK(verdict.slips == 0);
    CHECK(verdict.frame_reasons[EventReason::exposure_missing] == 1);
    CHECK(verdict.published == verdict.frames - 1);
}

TEST_CASE("pairing: a late exposure record is waited for") {
    CHECK(run(with(FaultKind::record_late)).withheld == 0);
}

TEST_CASE("pairing: a link that often holds records up does not keep a camera from being paired") {
    WorldSettings settings = world(GENERATE(range(1U, 40U)));
    settings.held_records = 0.5;
    settings.rate_hz = GENERATE(20.0, 155.0);
    const Verdict verdict = run(settings);
    CAPTURE(settings.seed, settings.rate_hz);
    CHECK(verdict.starts <= 1);
    CHECK(static_cast<double>(verdict.first_published.ns) * 1e-9 * settings.rate_hz < 150);
}

TEST_CASE("pairing: records that are all late delay the first frames by no more than that") {
    for (const double rate_hz : {10.0, 20.0, 50.0})
        for (const std::int64_t late_ms : {15, 30, 60, 100, 150, 200})
            for (std::uint64_t seed = 0; seed < 8; ++seed) {
                INFO(rate_hz << " Hz, " << late_ms << " ms, seed " << seed);
                WorldSettings settings = world(seed);
                settings.rate_hz = rate_hz;
                settings.record_delay = milliseconds(late_ms);
                settings.strobe = seed % 2 != 0;
                if (seed % 4 > 1) settings.readout = milliseconds(20);
                const Verdict verdict = run(settings);
                CHECK(verdict.published > 0.9 * static_cast<double>(verdict.frames));
                CHECK(verdict.first_published < seconds(2));
            }
}

TEST_CASE("pairing: waiting for exposure records is bounded, and goes on when they come again") {
    Verdict verdict = run(with(FaultKind::usb_stall));
    CHECK(verdict.frame_reasons[EventReason::exposure_missing] > 20);
    CHECK(verdict.withheld <= 42);  // two seconds
    CHECK(verdict.slips == 0);
}

TEST_CASE("pairing: a frame that comes after a newer one, or twice, is left out and is no slip") {
    Verdict verdict = run(with(FaultKind::frames_reordered));
    CHECK(verdict.frame_reasons[EventReason::out_of_order] == 1);
    CHECK(verdict.withheld == 1);
    CHECK(verdict.slips == 0);
}

TEST_CASE(
    "pairing: ids that begin anew are a slip that clock and arrival repair within five frames") {
    const Verdict verdict = run(with(GENERATE(FaultKind::id_restart, FaultKind::duplicate_id)));
    CHECK(verdict.slips == 1);
    CHECK(verdict.withheld <= 5);
    CHECK(verdict.starts == 0);
}

TEST_CASE("pairing: a camera clock that jumps, even by whole periods, is found, not followed") {
    WorldSettings settings = with(FaultKind::clock_jump);
    settings.seed = GENERATE(range(1, 30));
    settings.faults[120] = FaultKind::clock_jump;
    settings.readout =
        GENERATE(microseconds(2500), milliseconds(60));  // below and above the period
    const Verdict verdict = run(settings);
    CHECK(verdict.withheld_needlessly == 0);
    CHECK(verdict.starts <= 2);  // only whole periods need the pattern
}

TEST_CASE("pairing: frames from before the start are never published") {
    const Verdict verdict = run(with(FaultKind::stale_frame));
    CHECK(verdict.recoveries.size() == 1);
    CHECK(verdict.recoveries.front() < seconds(1));
}

TEST_CASE(
    "pairing: frames that queue in the camera until one is dropped are not taken for their "
    "neighbours") {
    WorldSettings settings = world();
    settings.seed = GENERATE(range(1, 6));
    settings.pulses = 2000;
    settings.link_load = GENERATE(1.001, 1.003, 1.01);
    settings.strobe = GENERATE(true, false);
    settings.drops_after_exposure = GENERATE(true, false);
    settings.ids_count_ignored = GENERATE(true, false);
    settings.clock = GENERATE(WorldClock::drifting, WorldClock::absent);
    const Verdict verdict = run_world(settings);
    CHECK(verdict.wrong == 0);
    CHECK(verdict.published > 0);
}

TEST_CASE("pairing: ids and clock that both step while no record comes are no dead end") {
    WorldSettings settings = world();
    settings.seed = GENERATE(range(1, 30));
    settings.rate_hz = GENERATE(20.0, 155.0);
    settings.faults = {{80, FaultKind::usb_stall},
                       {81, FaultKind::record_lost},
                       {90, FaultKind::id_restart},
                       {100, FaultKind::clock_jump}};
    settings.pulses = 900;
    CHECK(run(settings).unproved_at_end < seconds(1));
}

TEST_CASE("pairing: swapped cameras are never proved") {
    WorldSettings settings = with(FaultKind::cameras_swapped);
    settings.pulses = 1000;
    settings.clock = GENERATE(WorldClock::good, WorldClock::absent);
    const Verdict verdict = run_world(settings);
    CHECK(verdict.published == 0);
    CHECK(verdict.final_state == State::searching);
    CHECK(verdict.starts > 3);  // it goes on trying
}

TEST_CASE("pairing: whatever instant a camera stamps, exposures that change cost no frame") {
    WorldSettings settings = world();
    settings.stamped = GENERATE(Instant::start, Instant::middle, Instant::end);
    settings.readout_start = settings.stamped == Instant::end
                                 ? GENERATE(milliseconds(0), milliseconds(1))
                                 : milliseconds(0);
    settings.pulses = 600;
    settings.exposure = milliseconds(2);
    settings.other_exposure = milliseconds(30);
    settings.switched_every = GENERATE(1U, 7U, 66U);
    const Verdict verdict = run(settings);
    CHECK(verdict.slips == 0);
    CHECK(verdict.withheld == 0);
    CHECK(verdict.stamped == settings.stamped);
}

TEST_CASE("pairing: what a camera stamps stays unknown while its exposures do, and costs nothing") {
    WorldSettings settings = world();
    settings.stamped = Instant::end;
    settings.exposure = settings.other_exposure = milliseconds(5);
    const Verdict verdict = run(settings);
    CHECK(verdict.stamped == Instant::unknown);
    CHECK(verdict.withheld == 0);
}

TEST_CASE("pairing: a board whose time steps is never followed to other triggers") {
    WorldSettings settings =
        with(GENERATE(FaultKind::board_time_step, FaultKind::board_time_step_grid));
    settings.seed = GENERATE(range(1, 30));
    settings.clock = GENERATE(WorldClock::good, WorldClock::absent);
    settings.pulses = 400;
    CHECK(run(settings).lies_published == 0);
}

TEST_CASE("pairing: a board whose time steps while the link stalls is not believed meanwhile") {
    const bool fast = GENERATE(false, true);
    WorldSettings settings = world(GENERATE(range(20U, 45U)));
    settings.rate_hz = fast ? 155 : 20;
    settings.faults = {{120, FaultKind::usb_stall},
                       {fast ? 220 : 130, FaultKind::board_time_step_grid},
                       {fast ? 260 : 135, FaultKind::duplicate_id}};
    settings.pulses = fast ? 1400 : 400;
    run(settings);
}

TEST_CASE("pairing: ids that stay one behind are not confirmed by a single frame's arrival") {
    WorldSettings settings = world(GENERATE(range(1U, 30U)));
    settings.clock = WorldClock::absent;
    settings.rate_hz = 155;
    settings.exposure = microseconds(500);
    settings.other_exposure = milliseconds(3);
    settings.switched_every = 1;  // the ends of neighbours lie closer than their starts
    settings.faults[8] = FaultKind::duplicate_id;
    settings.pulses = 300;
    CHECK(run_world(settings).wrong == 0);
}

TEST_CASE("pairing: ids that begin anew cost a camera without a clock few frames, and no start") {
    WorldSettings settings = world(GENERATE(range(1U, 10U)));
    settings.clock = WorldClock::absent;
    settings.rate_hz = GENERATE(20.0, 155.0);
    settings.first_id = 1000;
    settings.faults[80] = FaultKind::id_restart;
    const Verdict verdict = run(settings);
    CHECK(verdict.withheld <= 8);
    CHECK(verdict.starts == 1);  // the steady one, after the slow
}

TEST_CASE("pairing: one record that lies costs few frames, and none is published by it") {
    WorldSettings settings = with(FaultKind::lying_record);
    settings.seed = GENERATE(range(1, 60));
    const Verdict verdict = run(settings);
    CHECK(verdict.lies_published == 0);
    CHECK(verdict.withheld <= 6);
    CHECK(verdict.starts == 0);
}

TEST_CASE("pairing: the exposures that are kept reach as far back as frames may be late") {
    CHECK(pairing::longest_latest_arrival(milliseconds(50)) > seconds(49));
    CHECK(pairing::longest_latest_arrival(milliseconds(1)) > milliseconds(700));
    WorldSettings settings = world();
    settings.rate_hz = 1000;
    settings.jitter = microseconds(100);
    settings.readout = milliseconds(300);  // of 300 exposures, beyond what was once kept
    settings.pulses = 2000;
    const Verdict verdict = run(settings);
    CHECK(verdict.withheld == 0);
}

namespace {

struct Nobody final : pairing::Outcome {
    void paired(const pairing::Arrival& /*a*/, const pairing::Exposure& /*e*/) override {}
    void frame_unpaired(const pairing::Arrival& /*a*/, EventReason /*r*/,
                        const pairing::Exposure* /*guess*/) override {}
    void exposure_unpaired(const pairing::Exposure& /*e*/, EventReason /*r*/) override {}
    void locked(const pairing::Exposure& /*e*/) override {}
    void slipped(const pairing::Arrival& /*a*/) override {}
};

}  // namespace

TEST_CASE("pairing: a start ends when the board has carried it out, or was asked for steady ones") {
    Nobody nobody;
    pairing::Limits limits;
    pairing::Pairing paired(limits, nobody);
    const HostTime begin{1'000'000'000'000};
    Duration carried_out = limits.pattern_duration + limits.latest_arrival;
    SECTION("a reset does not end it") {
        paired.start_requested(pairing::Start::pattern, begin);
        paired.reset();
    }
    SECTION("a slow one") {
        paired.start_requested(pairing::Start::slow, begin - seconds(3));
        paired.start_requested(pairing::Start::steady, begin);
        paired.reset();
        carried_out = limits.latest_arrival;
    }
    for (int i = 0; i < 12; ++i) {
        pairing::Arrival arrival;
        arrival.block_id = static_cast<std::uint64_t>(i) + 1;
        arrival.arrived = begin + milliseconds(50) * i;
        arrival.camera_time = {arrival.arrived.ns};
        paired.add(arrival);
    }
    CHECK_FALSE(paired.wanted_start(begin + carried_out));
    CHECK(paired.wanted_start(begin + carried_out + milliseconds(1)) == pairing::Start::pattern);
}

TEST_CASE("pairing: the same world has the same verdict") {
    WorldSettings settings = with(FaultKind::clock_jump);
    settings.late_frames = 0.05;
    const Verdict first = run_world(settings);
    const Verdict second = run_world(settings);
    CHECK(first.published == second.published);
    CHECK(first.frame_reasons == second.frame_reasons);
}
