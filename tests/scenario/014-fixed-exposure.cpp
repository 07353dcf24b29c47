// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "014-fixed-exposure: a thermal or time-of-flight camera without exposure line is predicted, "
    "and said to "
    "be") {
    Scenario world;
    CameraSettings settings;
    settings.strobe = false;
    settings.latency = 2 * ms;
    settings.exposure = [](auto, auto) { return 8 * ms; };
    world.add_camera(2, settings, 9'000'000);
    world.configuration.cameras[2].exposure_ns = 8 * ms;
    REQUIRE(world.begin());
    world.run(20 * second);
    world.finish();
    CHECK(world.judge() == "");
    REQUIRE(world.inbox().exposures[2].size() >= 179);
    for (const wire::Exposure& record : world.inbox().exposures[2]) {
        const TruePulse& pulse = world.camera(2).pulses()[record.trigger - 1];
        REQUIRE(record.flags == wire::exposure_predicted);
        REQUIRE(record.start_ns == pulse.start);
        REQUIRE(record.end_ns == pulse.end);
        REQUIRE(world.grid_error(record) == 0);
    }
}
