// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "038-bouncing-strobe: an exposure lasts from the first edge of its start to that of its end") {
    Scenario world;
    CameraSettings settings;
    settings.bounces = {200, 900, 2'400, 4'700};
    settings.strobe_inverted = GENERATE(false, true);
    world.add_camera(0, settings);
    world.add_camera(1);
    world.configuration.illumination = {1, 0, 0, 100'000, 10'000'000, 500'000};
    REQUIRE(world.begin());
    world.run(3 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& records = world.inbox().exposures[0];
    REQUIRE(records.size() >= 59);
    for (const wire::Exposure& record : records)
        REQUIRE((record.flags & wire::exposure_measured) != 0);
    world.run(second);
    CHECK(world.inbox().healths.back().glitches == records.size() * 16);
    CHECK(world.inbox().healths.back().stray_edges == 0);
}

TEST_CASE("038-filter-width: it is what the configuration says, and shorter pulses are left out") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 8 * us; };
    world.add_camera(0, settings);
    world.add_camera(1, settings);
    world.configuration.cameras[1].glitch = 100;  // 10 us
    REQUIRE(world.begin());
    world.run(2 * second);
    world.finish();
    for (const wire::Exposure& record : world.inbox().exposures[0])
        REQUIRE((record.flags & wire::exposure_measured) != 0);
    for (const wire::Exposure& record : world.inbox().exposures[1])
        REQUIRE((record.flags & wire::exposure_no_start) != 0);
    world.run(second);
    CHECK(world.inbox().healths.back().glitches == 2 * world.inbox().exposures[1].size());
}

TEST_CASE("038-busy-inputs: noise just below the limit is no reason to lose anything") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) world.add_camera(camera);
    world.configuration.ports.inputs = 1U << wire::pulse_aux0;
    REQUIRE(world.begin());
    world.add_noise(firmware::input_pulse + unsigned{wire::pulse_aux0}, 80 * us, second,
                    3 * second);
    world.run(4 * second);
    world.finish();
    CHECK(world.inbox().events_of(wire::BoardEventKind::input_noisy).empty());
    CHECK(world.inbox().healths.back().lost_edges == 0);
    world.configuration.ports.inputs = 0;
    for (unsigned camera = 0; camera < 4; ++camera)
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
}
