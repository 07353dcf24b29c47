// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "003-exposure-halved: an exposure that ends before its expected middle has a stamp, and no "
    "phase "
    "shifts") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse < 50 ? 20 * ms : 5 * ms; };
    world.add_camera(0, settings);
    REQUIRE(world.begin());
    world.run(10 * second);
    world.finish();
    CHECK(world.judge() == "");
    const wire::Exposure& first = world.record(0, 50);
    CHECK((first.flags & wire::exposure_measured) != 0);
    CHECK(first.end_ns < world.grid_time(0, first.tick));
    CHECK(world.grid_error(first) == -15 * ms / 2);
    for (std::uint64_t trigger = 51; trigger < 190; ++trigger)
        REQUIRE(world.grid_error(world.record(0, trigger)) == 0);
}
