// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "032-full-load: an IMU as fast as the port reads one and four cameras at 200 Hz, without a "
    "drop, at the link's budget") {
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.exposure = [](auto, auto) { return 2 * ms; };
        world.add_camera(camera, settings, 200'000'000);
    }
    world.add_imu(std::make_unique<devices::Icm42688pDevice>(&World::motion),
                  wire::ImuKind::icm42688p, 8000, true);
    world.set_link(
        76'923, 64,
        128);  // thirteen of the nineteen packets that a millisecond of full speed carries
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9);
    world.connect();
    const std::uint32_t fastest = world.inbox().hellos[0].fastest_imu_millihertz;
    world.configuration.imus[0].rate_millihertz = fastest;
    REQUIRE(world.begin());
    world.run(20 * second);
    world.finish();
    CHECK(world.judge() == "");
    const wire::Health& health = world.inbox().healths.back();
    CHECK(health.dropped_exposures + health.dropped_clock_answers + health.dropped_events +
              health.dropped_imu_samples + health.lost_edges + health.late_outputs ==
          0);
    CHECK(world.inbox().samples[0].size() >= fastest / 1000 * 79 / 4);
    for (unsigned camera = 0; camera < 4; ++camera)
        CHECK(world.inbox().exposures[camera].size() >= 3990);
}
