// SPDX-License-Identifier: BSD-3-Clause
#include <set>

#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "006-usb-stalled: a host that does not read disturbs no trigger and no sample, exposures "
    "outlive "
    "samples") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) world.add_camera(camera);
    auto device =
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion);
    world.add_imu(std::move(device), wire::ImuKind::adis16448b, 800, true);
    world.drops_allowed = true;
    REQUIRE(world.begin());
    world.run(5 * second);
    world.stall_host(3 * second);
    world.send(wire::ClockRequest{7, 0});
    world.run(10 * second);
    world.finish();
    CHECK(world.judge() == "");
    std::set<std::uint64_t> triggers;
    for (unsigned camera = 0; camera < 4; ++camera) {
        REQUIRE(world.inbox().exposures[camera].size() == world.camera(camera).pulses().size());
        for (std::uint64_t trigger = 2; trigger < 290; ++trigger)
            REQUIRE(world.grid_error(world.record(camera, trigger)) == 0);
    }
    REQUIRE(world.inbox().clock_answers.size() == 1);
    CHECK(world.inbox().clock_answers[0].id == 7);
    // Samples were dropped and counted; each one that arrived is right (judge); the newest were
    // kept.
    const wire::Health& health = world.inbox().healths.back();
    CHECK(health.dropped_exposures == 0);
    CHECK(health.dropped_clock_answers == 0);
    CHECK(health.dropped_imu_samples > 1500);
    const auto& samples = world.inbox().samples[0];
    const std::uint32_t made = samples.back().number - samples.front().number + 1;
    CHECK(made == samples.size() + health.dropped_imu_samples);
}
