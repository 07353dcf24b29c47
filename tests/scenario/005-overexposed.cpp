// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("005-overexposed: an exposure longer than the period costs triggers, never the grid") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) {
        if (pulse == 20) return 70 * ms;   // beyond the period
        if (pulse == 40) return 300 * ms;  // beyond the maximum
        return 5 * ms;
    };
    world.add_camera(0, settings);
    world.configuration.cameras[0].max_exposure_ns = 100 * ms;
    world.busy_allowed = true;  // while the long one continues after the board gave up on it
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    const wire::Exposure& longer = world.record(0, 20);
    CHECK(std::abs(longer.end_ns - longer.start_ns - 70 * ms) <= world.rounding());
    CHECK((longer.flags & wire::exposure_overlong) != 0);
    // The next grid point finds it exposing; the one after asks for a trigger before its end.
    CHECK(world.record(0, 21).tick == longer.tick + 3);
    const wire::Exposure& too_long = world.record(0, 40);
    CHECK(too_long.end_ns == wire::no_time);
    CHECK((too_long.flags & wire::exposure_overlong) != 0);
    CHECK(world.inbox().events_of(wire::BoardEventKind::trigger_skipped).size() >= 3);
    CHECK(world.grid_error(world.record(0, 60)) == 0);
}
