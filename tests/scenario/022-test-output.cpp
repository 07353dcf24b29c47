// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("022-test-output: a pulse at the grid point, where the middle of the exposure is") {
    Scenario world;
    world.add_camera(1);
    world.configuration.ports.test = wire::test_camera0 + 1;
    world.configuration.ports.pulse_ns = 50'000;
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& rises = world.rises(firmware::pin_test);
    REQUIRE(rises.size() == world.camera(1).pulses().size());
    for (std::size_t i = 0; i < rises.size(); ++i)
        REQUIRE(std::abs(rises[i] - world.grid_time(1, world.inbox().exposures[1][i].tick)) <=
                world.rounding());
}

TEST_CASE("022-test-imu: a pulse at each tick of the IMU") {
    const bool data_ready = GENERATE(false, true);
    Scenario world;
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 200, data_ready);
    world.configuration.ports.test = wire::test_imu0;
    world.configuration.ports.pulse_ns = 50'000;
    REQUIRE(world.begin());
    world.run(5 * second);
    CHECK(world.judge() == "");
    const auto& rises = world.rises(firmware::pin_test);
    REQUIRE(world.inbox().samples[0].size() > 900);
    for (const wire::ImuSample& sample : world.inbox().samples[0]) {
        const Nanoseconds later = data_ready ? 0 : world.reading_delay();
        const auto next =
            std::lower_bound(rises.begin(), rises.end(), sample.time_ns - later - world.rounding());
        REQUIRE(next != rises.end());
        REQUIRE(*next - sample.time_ns <= firmware::routing_latency_limit + world.rounding());
    }
}
