// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "007-announced: exposures that the host announces lie on the grid from the first one on") {
    Scenario world;
    const auto exposure = [](std::uint64_t pulse) {
        return (2 + static_cast<Nanoseconds>(pulse * 7 % 23)) * ms;
    };
    CameraSettings settings;
    settings.exposure = [exposure](std::uint64_t pulse, auto) { return exposure(pulse); };
    world.add_camera(0, settings);
    REQUIRE(world.begin());
    // Three ahead, as an auto exposure on the host announces them.
    for (std::uint64_t trigger = 1; trigger < 400; ++trigger) {
        while (world.camera(0).pulses().size() + 3 < trigger) world.run(ms);
        world.send(wire::ExpectedExposure{0, {}, trigger, exposure(trigger)});
    }
    world.finish();
    CHECK(world.judge() == "");
    for (std::uint64_t trigger = 4; trigger < 390; ++trigger) {
        REQUIRE((world.record(0, trigger).flags & wire::exposure_announced) != 0);
        REQUIRE(world.grid_error(world.record(0, trigger)) == 0);
    }
}

TEST_CASE("007-announced-too-long: more than the maximum exposure is clipped, and said to be") {
    Scenario world;
    world.add_camera(0);
    world.configuration.cameras[0].max_exposure_ns = 10 * ms;
    REQUIRE(world.begin());
    world.send(wire::ExpectedExposure{0, {}, 5, second});
    world.run(second);
    world.finish();
    CHECK(world.judge() == "");
    const wire::Exposure& record = world.record(0, 5);
    CHECK((record.flags & wire::exposure_clipped) != 0);
    const Nanoseconds ahead = world.grid_time(0, record.tick) - record.trigger_ns;
    CHECK(std::abs(ahead - 5 * ms - 20 * us) <= world.rounding());
}
