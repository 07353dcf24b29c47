// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "019-pps: each pulse is an event with its number, they show how fast the board's clock runs") {
    const double ppm = GENERATE(-107.0, -3.2, 0.0, 41.5);
    Scenario world;
    world.add_camera(0);
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9 * (1 + ppm * 1e-6));
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::pps).size() >= 60);
    const wire::Health& health = world.inbox().healths.back();
    CHECK(health.pps_state == wire::PpsState::good);
    CHECK(std::abs(health.pps_error_ppb - ppm * 1000) <= 1 + world.rounding());
}

TEST_CASE("019-pps-noise: a pulse between pulses, and echoes of each, disturb nothing") {
    Scenario world;
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9 + 12'000);
    REQUIRE(world.begin());
    world.board().schedule_edge({20'750 * ms, firmware::input_pulse, true});
    world.board().schedule_edge({20'751 * ms, firmware::input_pulse, false});
    for (int i = 5; i < 30; ++i) {
        const Nanoseconds echo = 300 * ms + i * (second + 12'000) + 30 * us;
        world.board().schedule_edge({echo - 10 * us, firmware::input_pulse, false});
        world.board().schedule_edge({echo, firmware::input_pulse, true});
    }
    world.run(31 * second);
    for (const wire::Health& health : world.inbox().healths) {
        if (health.board_time_ns < 5 * second) continue;
        REQUIRE(health.pps_state == wire::PpsState::good);
        REQUIRE(std::abs(health.pps_error_ppb - 12'000) <= world.rounding());
    }
    CHECK(world.inbox().healths.back().glitches == 25);
    CHECK(world.inbox().events_of(wire::BoardEventKind::pps).size() == 32);
}

TEST_CASE("019-pps-lost: pulses that stop are no frequency, those of another phase are one soon") {
    Scenario world;
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9 + 12'000);
    REQUIRE(world.begin());
    world.run(20 * second);
    world.stop_pulses();
    world.run(12 * second);
    CHECK(world.inbox().healths.back().pps_state == wire::PpsState::none);
    CHECK(world.inbox().healths.back().pps_error_ppb == 0);
    world.add_pulses(wire::pulse_pps, 33'777 * ms, 1e9 - 7'000);
    world.run(6 * second);
    CHECK(world.inbox().healths.back().pps_state == wire::PpsState::good);
    CHECK(std::abs(world.inbox().healths.back().pps_error_ppb + 7'000) <= world.rounding());
    world.stop_pulses();
    world.add_pulses(wire::pulse_pps, 39'111 * ms, 1e9 + 3'000);  // without a pause
    world.run(2 * second);
    CHECK(std::abs(world.inbox().healths.back().pps_error_ppb + 7'000) <= world.rounding());
    world.run(8 * second);
    CHECK(world.inbox().healths.back().pps_state == wire::PpsState::good);
    CHECK(std::abs(world.inbox().healths.back().pps_error_ppb - 3'000) <= world.rounding());
}
