// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "019-pps: each pulse is an event with its number, they tell how fast the board's clock runs") {
    const double ppm = GENERATE(-107.0, -3.2, 0.0, 41.5);
    Scenario world;
    world.add_camera(0);
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9 * (1 + ppm * 1e-6));
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::EventKind::pps).size() >= 60);
    const wire::Health& health = world.inbox().healths.back();
    CHECK(health.pps_state == wire::PpsState::good);
    CHECK(health.pps_error_ppb == Approx(ppm * 1000).margin(1));
}

TEST_CASE("019-pps-lost: pulses that stop, and noise between pulses, are no frequency") {
    Scenario world;
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9);
    REQUIRE(world.begin());
    world.board().schedule_edge({20'750 * ms, firmware::input_pulse, true});
    world.board().schedule_edge({20'751 * ms, firmware::input_pulse, false});
    world.run(21 * second);
    CHECK(world.inbox().healths.back().pps_state != wire::PpsState::good);
    world.run(10 * second);
    CHECK(world.inbox().healths.back().pps_state == wire::PpsState::good);
    CHECK(world.inbox().healths.back().pps_error_ppb == 0);
}
