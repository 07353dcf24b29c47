// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("025-failed-read: it is flagged and counted, and the next sample is none the worse") {
    Scenario world;
    auto device =
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion);
    devices::AdisDevice& part = *device;
    world.add_imu(std::move(device), wire::ImuKind::adis16448b, 819.2, true);
    REQUIRE(world.begin());
    for (int i = 0; i < 10; ++i) {
        world.run(500 * ms);
        part.corrupt(2);
    }
    world.run(second);
    CHECK(world.judge() ==
          "");  // every good sample is right, stamped by its edge, and none is missing
    std::size_t failed = 0;
    for (const wire::ImuSample& sample : world.inbox().samples[0])
        failed += (sample.flags & wire::imu_check_failed) != 0 ? 1 : 0;
    CHECK(failed == 20);
    CHECK(world.inbox().healths.back().imu_errors[0] == 20);
    CHECK(world.inbox().healths.back().imu_restarts == 0);
}

TEST_CASE("025-self-test: what the part says of itself is passed on") {
    Scenario world;
    auto device =
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16470, &World::motion);
    devices::AdisDevice& part = *device;
    world.add_imu(std::move(device), wire::ImuKind::adis16470, 500, true);
    REQUIRE(world.begin());
    world.run(second);
    part.diagnose(0x20);
    world.run(100 * ms);
    const auto& samples = world.inbox().samples[0];
    CHECK(std::count_if(samples.begin(), samples.end(), [](const auto& sample) {
              return (sample.flags & wire::imu_self_test_failed) != 0;
          }) == 1);
}

TEST_CASE(
    "025-unplugged: a part that comes off is reported, flagged, and set up again when it is back, "
    "cameras go "
    "on") {
    Scenario world;
    auto device = std::make_unique<devices::Icm42688pDevice>(&World::motion);
    devices::Icm42688pDevice& part = *device;
    world.add_imu(std::move(device), wire::ImuKind::icm42688p, 1000, GENERATE(true, false));
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(2 * second);
    part.unplug(true);
    world.run(3 * second);
    const auto silent = world.inbox().events_of(wire::BoardEventKind::imu_silent).size();
    const auto failed = world.inbox().events_of(wire::BoardEventKind::imu_failed).size();
    CHECK(silent + failed >= 2);
    part.unplug(false);
    world.run(3 * second);
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 2);
    world.finish();
    world.drops_allowed = true;  // the time without it has no samples
    CHECK(world.judge() == "");
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
}

TEST_CASE(
    "025-wrong-part: another part than configured is refused by its identity, once a second") {
    Scenario world;
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16445, &World::motion),
        wire::ImuKind::adis16448b, 200, true);
    REQUIRE(world.begin());
    world.run(10 * second);
    const auto failures = world.inbox().events_of(wire::BoardEventKind::imu_failed);
    CHECK(failures.size() >= 8);
    CHECK(failures.size() <= 11);
    CHECK(failures[0].value == 16445);
    CHECK(world.inbox().samples[0].empty());
}

TEST_CASE(
    "025-dead-bus: zeros or ones are no data, whatever the part, it is reported, and set up "
    "again") {
    const std::uint8_t level = GENERATE(std::uint8_t{0x00}, std::uint8_t{0xFF});
    const bool data_ready = GENERATE(true, false);
    for (const wire::ImuKind kind : spi_imu_kinds) {
        INFO("kind " << int(kind) << ", level " << int(level));
        Scenario world;
        world.add_imu(make_imu(kind), kind, 200, data_ready);
        REQUIRE(world.begin());
        world.run(2 * second);
        world.set_dead_bus(level);
        const std::size_t before = world.inbox().samples[0].size();
        world.run(3 * second);
        const auto& samples = world.inbox().samples[0];
        for (std::size_t i = before + 3; i < samples.size(); ++i)
            REQUIRE((samples[i].flags & wire::imu_check_failed) != 0);
        CHECK_FALSE(world.inbox().events_of(wire::BoardEventKind::imu_failed).empty());
        world.set_dead_bus(std::nullopt);
        world.run(3 * second);
        CHECK(samples.size() > before + 250);
        CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 2);
        world.drops_allowed = true;  // the time without it has no samples
        // On the board's grid the judge does not know when the part took its data before it was set
        // up again.
        if (data_ready) CHECK(world.judge() == "");
    }
}

TEST_CASE("025-brown-out: a part that lost its settings is found out and set up again") {
    const bool data_ready = GENERATE(true, false);
    for (const wire::ImuKind kind : spi_imu_kinds) {
        const bool adis = kind != wire::ImuKind::icm42688p && kind != wire::ImuKind::bmi088;
        if (adis && !data_ready && kind != wire::ImuKind::adis16448b)
            continue;  // its data is as good
        INFO("kind " << int(kind));
        Scenario world;
        world.add_imu(make_imu(kind), kind, 200, data_ready);
        REQUIRE(world.begin());
        world.run(2 * second);
        world.spi_imu().brown_out(world.now());
        world.run(3 * second);
        CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 2);
        const std::size_t before = world.inbox().samples[0].size();
        world.run(second);
        const std::size_t rate = world.inbox().samples[0].size() - before;
        CHECK(rate >= 195);
        CHECK(rate <= 260);
    }
}
