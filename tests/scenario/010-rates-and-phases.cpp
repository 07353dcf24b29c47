// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("010-rates-and-phases: four rates and phases on one grid") {
    Scenario world;
    const std::uint32_t rates[] = {7'000'000, 14'000'000, 29'970'000, 90'000'000};
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.exposure = [](auto, auto) { return 2 * ms; };
        world.add_camera(camera, settings, rates[camera]);
        world.configuration.cameras[camera].phase_ns = camera * 1'234'567;
    }
    REQUIRE(world.begin());
    world.run(120 * second);
    world.finish();
    CHECK(world.judge() == "");
    for (unsigned camera = 0; camera < 4; ++camera)
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    // Every second frame of the 14 Hz camera falls on one of the 7 Hz camera, apart from the phase.
    CHECK(world.grid_time(1, 2000) - world.grid_time(0, 1000) == 1'234'567);
}
