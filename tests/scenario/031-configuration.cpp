// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "031-configuration: it is taken whole or not at all, and each field that is refused is named "
    "with its "
    "range") {
    Scenario world;
    world.add_camera(0);
    world.connect();
    REQUIRE(world.configure());
    const wire::Configuration good = world.configuration;
    world.add_camera(2, {}, 99'999);
    world.configuration.cameras[0].pulse_ns = 26'000'000;
    world.configuration.cameras[1] = world.configuration.cameras[0];
    world.configuration.cameras[1].pulse_ns = 1'000;
    world.configuration.cameras[1].flags |= wire::camera_slave;
    world.configuration.cameras[1].master = 1;
    world.configuration.imus[0] = {wire::ImuKind::adis16470, 9, wire::imu_data_ready, 0, 5'000'000};
    world.configuration.imus[1] = {wire::ImuKind::bmi088, 0, 0, 0, 100'000};
    world.configuration.illumination = {1, 0, 0, 2'000'000, 1'000, 0};
    world.configuration.ports.inputs = 0x40;
    world.configuration.ports.sync_rate_uhz = 99;
    CHECK_FALSE(world.configure());
    using Field = wire::ConfigurationField;
    std::vector<Field> refused;
    for (const wire::Refusal& refusal : world.inbox().refusals) {
        CHECK(refusal.id == world.configuration.id);
        CHECK((refusal.value < refusal.minimum || refusal.value > refusal.maximum));
        refused.push_back(refusal.field);
    }
    CHECK(refused == std::vector<Field>{Field::pulse, Field::master, Field::rate, Field::imu_rate,
                                        Field::imu_filter, Field::imu_kind, Field::lead,
                                        Field::max_on, Field::duty, Field::inputs, Field::sync_rate,
                                        Field::pulse});
    const wire::ConfigurationAnswer& answer = world.inbox().answers.back();
    CHECK(answer.status == wire::ConfigurationStatus::refused);
    CHECK(answer.refused == refused.size());
    CHECK(std::memcmp(&answer.taken, &good, sizeof good) == 0);  // what was in force stays
}

TEST_CASE(
    "031-disabled-nonsense: what a camera that is not enabled is configured with does not matter") {
    Scenario world;
    world.add_camera(0);
    world.configuration.cameras[2].flags = wire::camera_slave;
    world.configuration.cameras[2].master = 200;
    REQUIRE(world.begin());
    world.run(second);
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE("031-while-running: a configuration is refused while cameras run") {
    Scenario world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(second);
    CHECK_FALSE(world.configure());
    CHECK(world.inbox().answers.back().status == wire::ConfigurationStatus::running);
    world.stop();
    CHECK(world.configure());
}

TEST_CASE(
    "031-announcement-for-nobody: words about cameras that do not exist, or impossible ones, "
    "change "
    "nothing") {
    Scenario world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.send(wire::ExpectedExposure{200, {}, 5, 10 * ms});
    world.send(wire::ExpectedExposure{0, {}, 5, -10 * ms});
    world.send(wire::Start{0xF0, 0xFF, {}});
    world.send(wire::Reboot{1, 1});
    world.run(2 * second);
    world.finish();
    CHECK(world.reboots() == 0);
    CHECK(world.judge() == "");
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    world.send(wire::Reboot{wire::reboot_magic, 1});
    world.run(ms);
    CHECK(world.reboots() == 1);
}
