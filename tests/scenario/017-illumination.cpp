// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("017-illumination: light leads each exposure and lasts through the union of all") {
    Scenario world;
    const bool shifted = GENERATE(false, true);
    for (unsigned camera = 0; camera < 3; ++camera) {
        CameraSettings settings;
        settings.jitter = 5 * us;
        settings.exposure = [camera](std::uint64_t pulse, auto) {
            return (1 + camera + static_cast<Nanoseconds>(pulse % 4)) * ms;
        };
        world.add_camera(camera, settings);
        if (shifted) world.configuration.cameras[camera].phase_ns = camera * 4'500'000;
    }
    world.configuration.illumination = {7, 0, 0, 200'000, 30'000'000, 800'000};
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::illumination_limited).empty());
    // Dark in between: on only for the exposures and their leads.
    Nanoseconds on = 0;
    for (const Interval& interval : world.lights()) on += interval.off - interval.on;
    Nanoseconds exposed = 0;
    for (unsigned camera = 0; camera < 3; ++camera)
        for (const TruePulse& pulse : world.camera(camera).pulses())
            exposed += pulse.end - pulse.start + 250 * us;
    CHECK(on <= exposed);
    CHECK(on >= 60 * 20 * 3 * ms);
}
