// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("001-steady: the middles of constant exposures lie on the grid, to the nanosecond") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.exposure = [camera](auto, auto) { return (2 + 2 * camera) * ms; };
        world.add_camera(camera, settings);
    }
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    for (unsigned camera = 0; camera < 4; ++camera) {
        REQUIRE(world.inbox().exposures[camera].size() >= 1199);
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    }
    // Cameras of one tick are exposed at one time.
    for (std::uint64_t trigger = 2; trigger < 1000; ++trigger)
        REQUIRE(world.record(0, trigger).tick == world.record(3, trigger).tick);
}
