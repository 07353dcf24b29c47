// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

/// Triggers that were skipped, by the events about them.
std::size_t skipped(World& world) {
    std::size_t count = world.inbox().events_of(wire::BoardEventKind::trigger_skipped).size();
    for (const wire::Event& event : world.inbox().events_of(wire::BoardEventKind::triggers_skipped))
        count += event.detail;
    return count;
}

}  // namespace

TEST_CASE("039-long-announcement: what is skipped at once is reported at once") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 300 * us; };
    world.add_camera(0, settings, 1'000'000'000);
    world.configuration.cameras[0].exposure_ns = 300 * us;
    world.configuration.cameras[0].max_exposure_ns = 10 * second;
    world.busy_allowed = true;
    REQUIRE(world.begin());
    world.run(second);
    world.send(wire::ExpectedExposure{0, {}, world.camera(0).pulses().size() + 20, 8 * second});
    world.run(12 * second);
    world.finish();
    CHECK(world.judge() == "");
    world.run(second);
    CHECK(world.inbox().healths.back().dropped_events == 0);
    CHECK(world.inbox().healths.back().skipped_triggers == skipped(world));
    CHECK(skipped(world) > 4'000);
    CHECK(world.inbox().events.size() < 400);
    CHECK(world.camera(0).pulses().size() > 4'000);
}

TEST_CASE("039-start-with-long-exposure: the first grid point that can be met is found directly") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 300 * us; };
    world.add_camera(0, settings, 1'000'000'000);
    world.configuration.cameras[0].exposure_ns = 10 * second;
    world.configuration.cameras[0].max_exposure_ns = 10 * second;
    REQUIRE(world.begin());
    // The first exposure shows how long it takes: the second needs to begin 5 s later.
    world.run(8 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& records = world.inbox().exposures[0];
    REQUIRE(records.size() > 1'000);
    CHECK(records[0].tick >= 5'000);
    CHECK(records[0].tick < 5'040);
    for (std::size_t i = 1; i < records.size(); ++i) REQUIRE(world.grid_error(records[i]) == 0);
}
