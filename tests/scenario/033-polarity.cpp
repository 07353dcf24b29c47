// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("033-polarity: each combination of trigger and strobe polarity, pulse width and gap") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.trigger_inverted = (camera & 1U) != 0;
        settings.strobe_inverted = (camera & 2U) != 0;
        world.add_camera(camera, settings);
        world.configuration.cameras[camera].pulse_ns = 1'000 + camera * 3'000'000;
    }
    REQUIRE(world.begin());
    // What is low when active rests high soon, long before any trigger, and is not late by that.
    for (const unsigned camera : {1U, 3U})
        CHECK(world.rises(camera).front() <= world.grid_time(camera, 0) + ms);
    world.run(20 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::output_late).empty());
    for (unsigned camera = 0; camera < 4; ++camera) {
        CHECK(world.camera(camera).pulses().size() >= 399);
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    }
}
