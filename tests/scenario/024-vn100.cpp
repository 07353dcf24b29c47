// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "024-vn100: set up by text, read as binary, stamped by its sync output, at a baud rate that "
    "carries it") {
    const double rate_hz = GENERATE(100.0, 400.0, 800.0);
    Scenario world;
    world.add_vn100(rate_hz, true);
    REQUIRE(world.begin());
    world.run(10 * second);
    CHECK(world.judge() == "");
    const auto& samples = world.inbox().samples[1];
    CHECK(static_cast<double>(samples.size()) == Approx(9.9 * rate_hz).epsilon(0.03));
    for (std::size_t i = 1; i < samples.size(); ++i)
        REQUIRE((samples[i].flags & wire::imu_stamped) != 0);
}

TEST_CASE(
    "024-vn100-late: a packet that comes much later than its sample is not stamped by another's "
    "edge") {
    Scenario world;
    world.add_vn100(100, true).delay(GENERATE(1000 * us, 1300 * us, 2600 * us));
    REQUIRE(world.begin());
    world.run(5 * second);
    CHECK(world.inbox().samples[1].size() > 400);
    // An age of more than its own period cannot be seen; it is the same for all then, and less than
    // the period.
    for (const wire::ImuSample& sample : world.inbox().samples[1]) {
        if ((sample.flags & wire::imu_stamped) == 0) continue;
        const Nanoseconds off = (sample.time_ns + 625 * us) % (1250 * us) - 625 * us;
        REQUIRE(std::abs(off) <= world.rounding());
    }
}

TEST_CASE(
    "024-vn100-still-streaming: a part that still talks as fast as it was set before is found",
    "[native]") {
    Scenario world;
    world.add_vn100(800, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    world.reboot(wire::ResetCause::watchdog);
    REQUIRE(world.begin());
    const std::size_t before = world.inbox().samples[1].size();
    world.run(4 * second);
    CHECK(world.inbox().samples[1].size() > before + 1500);
}

TEST_CASE(
    "024-vn100-faults: damaged packets are counted and missing by number, a mute part is found "
    "again") {
    Scenario world;
    devices::Vn100Device& part = world.add_vn100(200, true);
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(2 * second);
    part.corrupt(3);
    world.run(2 * second);
    CHECK(world.inbox().healths.back().imu_errors[1] >= 3);
    part.mute(true);
    world.run(3 * second);
    CHECK_FALSE(world.inbox().events_of(wire::BoardEventKind::imu_silent).empty());
    const std::size_t before = world.inbox().samples[1].size();
    part.mute(false);
    world.run(4 * second);
    CHECK(world.inbox().samples[1].size() > before + 300);
    world.finish();
    world.drops_allowed = true;  // the time of silence has no samples
    CHECK(world.judge() == "");
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
}
