// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

/// How far the grid points nearest to `pulses` are from them, at most.
Nanoseconds furthest(const std::vector<wire::Exposure>& records,
                     const std::vector<Nanoseconds>& pulses) {
    Nanoseconds most = 0;
    for (const Nanoseconds pulse : pulses) {
        Nanoseconds nearest = second;
        for (const wire::Exposure& record : records) {
            const Nanoseconds middle = record.start_ns + (record.end_ns - record.start_ns) / 2;
            nearest = std::min(nearest, std::abs(middle - pulse));
        }
        most = std::max(most, nearest);
    }
    return most;
}

/// A board whose camera follows sync pulses at 1 Hz that come from 500 ms on.
struct Follower : Scenario {
    Follower() {
        add_camera(0);
        pulses(500 * ms, 1e9 + 20'000);
        connect();
        REQUIRE(configure());
        start(1, wire::start_on_sync);
    }
    void pulses(Nanoseconds from, double period_ns) {
        add_pulses(wire::pulse_sync, from, period_ns);
    }
    wire::SyncState state() { return inbox().healths.back().sync_state; }
};

}  // namespace

TEST_CASE("040-sync-gap: a sender that drifted while it was silent is followed again") {
    Follower world;
    world.run(20 * second);
    CHECK(world.state() == wire::SyncState::followed);
    world.stop_pulses();
    world.run(300 * second);
    CHECK(world.state() == wire::SyncState::lost);
    const Nanoseconds from = 500 * ms + 321 * (second + 20'000) + 150'000;
    world.pulses(from, 1e9 + 20'500);
    world.run(30 * second);
    CHECK(world.state() == wire::SyncState::followed);
    REQUIRE(world.inbox().events_of(wire::BoardEventKind::sync_lost).size() == 1);
    REQUIRE(world.inbox().events_of(wire::BoardEventKind::sync_taken).size() == 1);
    std::vector<wire::Exposure> records = world.inbox().exposures[0];
    std::vector<Nanoseconds> pulses;
    for (int n = 15; n < 28; ++n) pulses.push_back(from + n * (second + 20'500));
    CHECK(furthest(records, pulses) < 1'000 + world.rounding());
}

TEST_CASE(
    "040-sync-began-anew: a sender with another phase is reported, and the grid slews to it") {
    Follower world;
    world.run(20 * second);
    world.stop_pulses();
    const Nanoseconds from = world.now() + 700 * ms;
    world.pulses(from, 1e9 - 3'000);
    world.run(250 * second);
    CHECK(world.state() == wire::SyncState::followed);
    const auto lost = world.inbox().events_of(wire::BoardEventKind::sync_lost);
    REQUIRE(lost.size() == 1);
    CHECK(world.is_stamp(lost[0].time_ns, from));
    const auto taken = world.inbox().events_of(wire::BoardEventKind::sync_taken);
    REQUIRE(taken.size() == 1);
    CHECK(std::abs(taken[0].value) > 100 * ms);
    // No interval is off by more than the slew and the crystals explain.
    const auto& records = world.inbox().exposures[0];
    for (std::size_t i = 2; i < records.size(); ++i) {
        const Nanoseconds gap = records[i].trigger_ns - records[i - 1].trigger_ns;
        REQUIRE(std::abs(gap - 50 * ms) < 60 * us);
    }
    world.run(200 * second);
    std::vector<Nanoseconds> pulses;
    for (int n = 440; n < 445; ++n) pulses.push_back(from + n * (second - 3'000));
    CHECK(furthest(world.inbox().exposures[0], pulses) < 1'000 + world.rounding());
}
