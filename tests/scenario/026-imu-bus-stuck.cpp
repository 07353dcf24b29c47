// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("026-imu-bus-stuck: a transfer that never ends holds up nothing else") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) world.add_camera(camera);
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16460, &World::motion),
        wire::ImuKind::adis16460, 200, true);
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9);
    REQUIRE(world.begin());
    world.run(3 * second);
    world.board().set_imu_bus_stuck(true);
    world.run(5 * second);
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_silent).size() >= 3);
    CHECK(world.inbox().healths.size() >= 7);
    world.board().set_imu_bus_stuck(false);
    const std::size_t before = world.inbox().samples[0].size();
    world.run(3 * second);
    CHECK(world.inbox().samples[0].size() > before + 200);
    world.finish();
    world.drops_allowed = true;
    CHECK(world.judge() == "");
    for (unsigned camera = 0; camera < 4; ++camera) {
        REQUIRE(world.inbox().exposures[camera].size() == world.camera(camera).pulses().size());
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    }
}
