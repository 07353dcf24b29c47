// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "020-aux-pulses: each pulse of two LiDARs is stamped, at rates that have nothing to do with "
    "the grid") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) world.add_camera(camera);
    world.add_pulses(wire::pulse_aux0, 117 * ms, 1e9 / 10.0137, 5 * us);
    world.add_pulses(wire::pulse_aux1, 30 * ms, 1e9 / 997.3, 20 * us);
    REQUIRE(world.begin());
    world.run(30 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::aux_pulse).size() >= 30'000);
}
