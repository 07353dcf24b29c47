// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("008-trigger-ignored: a camera that ignores triggers keeps its numbers and its grid") {
    const auto seed = GENERATE(range(1U, 6U));
    Scenario world(seed);
    CameraSettings settings;
    settings.jitter = 5 * us;
    settings.fault = [seed](std::uint64_t pulse) {
        return (pulse * 40503U + seed * 7919U) % 7 == 0 ? Fault::ignored : Fault::none;
    };
    world.add_camera(0, settings, 90'000'000);
    REQUIRE(world.begin());
    world.run(30 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(count(world.inbox().exposures[0], wire::exposure_no_start) > 200);
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1 && record.end_ns != wire::no_time)
            REQUIRE(std::abs(world.grid_error(record)) <= 5 * us);
}

TEST_CASE("008-readout: no trigger is sent into the read-out of a camera") {
    Scenario world;
    CameraSettings settings;
    settings.readout = 30 * ms;
    settings.exposure = [](std::uint64_t pulse, auto) {
        return pulse % 50 < 25 ? 10 * ms : 25 * ms;
    };
    world.add_camera(0, settings);
    REQUIRE(world.begin());
    world.run(30 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::trigger_skipped).size() > 20);
}
