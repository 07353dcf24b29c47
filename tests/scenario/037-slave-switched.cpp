// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("037-slave-switched: each pulse of a slave is whole, and has its number, however often") {
    const bool own_strobe = GENERATE(true, false);
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 2'400 * us; };
    world.add_camera(0, settings, 200'000'000);
    CameraSettings follower;
    follower.latency = 5 * us;
    follower.trigger_width = true;
    follower.strobe = own_strobe;
    world.add_camera(1, follower, 200'000'000);
    world.configuration.cameras[1].flags |= wire::camera_slave;
    world.gaps_allowed = true;
    REQUIRE(world.begin());
    // At every phase of the master's period.
    for (int i = 0; i < 2000; ++i) {
        world.run((3 + i % 7) * ms + i * 313);
        if (i % 2 == 0)
            world.stop(2);
        else
            world.start(2);
    }
    world.finish();
    CHECK(world.judge() == "");
    const auto& pulses = world.camera(1).pulses();
    CHECK(pulses.size() > 500);
    for (const TruePulse& pulse : pulses) REQUIRE(pulse.width == 2'400 * us);
    for (const wire::Exposure& record : world.inbox().exposures[1])
        REQUIRE((record.flags & wire::exposure_uncounted) == 0);
}
