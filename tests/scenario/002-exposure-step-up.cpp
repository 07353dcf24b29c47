// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "002-exposure-step-up: one exposure is off the grid by half the step, the next lie on it") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse < 50 ? 4 * ms : 16 * ms; };
    world.add_camera(0, settings);
    REQUIRE(world.begin());
    world.run(10 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.grid_error(world.record(0, 49)) == 0);
    CHECK(world.grid_error(world.record(0, 50)) == 6 * ms);
    for (std::uint64_t trigger = 51; trigger < 190; ++trigger)
        REQUIRE(world.grid_error(world.record(0, trigger)) == 0);
}
