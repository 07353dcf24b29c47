// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

/// What a flight controller does: identity once, then bursts.
std::vector<std::uint16_t> burst(Scenario& world) {
    std::vector<std::uint16_t> words(14);
    words[0] = 0x3E00;
    return world.native_board().read_imu_output(words);
}

void check_words(const std::vector<std::uint16_t>& words, Nanoseconds at,
                 double gyro_tolerance_deg_s, double accel_tolerance_g) {
    const devices::Inertial felt = World::motion(at);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto gyro = static_cast<std::int16_t>(words[2 + axis]);
        const auto accel = static_cast<std::int16_t>(words[5 + axis]);
        CHECK(gyro * 0.04 == Approx(felt.gyro_deg_s[axis]).margin(gyro_tolerance_deg_s));
        CHECK(accel / 1200.0 == Approx(felt.accel_g[axis]).margin(accel_tolerance_g));
    }
    const int temperature = static_cast<std::int16_t>(words[12] << 4U) / 16;
    CHECK(temperature * 0.07386 + 31 == Approx(felt.temperature_c).margin(0.15));
}

}  // namespace

TEST_CASE(
    "027-imu-output: a flight controller reads any IMU as an ADIS16448, and the host's samples do "
    "not "
    "suffer",
    "[native]") {
    const bool adis = GENERATE(true, false);
    Scenario world;
    if (adis)
        world.add_imu(
            std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
            wire::ImuKind::adis16448b, 819.2, true);
    else
        world.add_imu(std::make_unique<devices::Icm42688pDevice>(&World::motion),
                      wire::ImuKind::icm42688p, 1000, true);
    world.configuration.ports.options = wire::port_imu_output;
    REQUIRE(world.begin());
    world.run(second);
    const std::uint16_t question[] = {0x5600, 0x0000};
    CHECK(world.native_board().read_imu_output(question)[1] == 16448);
    for (int i = 0; i < 500; ++i) {
        world.run(3 * ms);
        const std::vector<std::uint16_t> words = burst(world);
        check_words(words, world.now(), 0.15, 0.002);
        if (adis) REQUIRE(words[13] != 0);
    }
    CHECK(world.judge() == "");
}

TEST_CASE(
    "027-imu-output-alone: with a stored configuration it serves from power-up, without any host",
    "[native]") {
    Scenario world;
    auto device =
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion);
    devices::AdisDevice& part = *device;
    world.add_imu(std::move(device), wire::ImuKind::adis16448b, 819.2, true);
    world.configuration.ports.options = wire::port_imu_output;
    world.configuration.flags = wire::configuration_store;
    world.connect();
    REQUIRE(world.configure());
    world.run(second);
    const auto stored = world.inbox().events_of(wire::BoardEventKind::stored);
    REQUIRE(stored.size() == 1);
    CHECK(stored[0].value == 1);
    world.reboot(wire::ResetCause::power_on);
    const std::uint64_t packets = world.inbox().packets;
    world.run(2 * second);
    CHECK(world.inbox().packets == packets);  // silent, but at work
    check_words(burst(world), world.now(), 0.15, 0.002);
    // A reading that failed its check is not served: the one before stays.
    const std::vector<std::uint16_t> before = burst(world);
    part.corrupt(1000);
    world.run(5 * ms);
    CHECK(std::abs(static_cast<std::int16_t>(burst(world)[2]) -
                   static_cast<std::int16_t>(before[2])) < 20);
}

TEST_CASE("027-power-fails: what was stored before is in force until the new one is safe",
          "[native]") {
    firmware::PortModel model;
    model.store_ns = 400 * ms;
    Scenario world(1, model);
    world.add_imu(make_imu(wire::ImuKind::icm42688p), wire::ImuKind::icm42688p, 500, true);
    world.configuration.flags = wire::configuration_store;
    world.connect();
    REQUIRE(world.configure());
    world.run(500 * ms);
    world.configuration.imus[0].rate_millihertz = 1'000'000;
    REQUIRE(world.configure());
    CHECK(world.inbox().events_of(wire::BoardEventKind::stored).size() == 1);
    const bool in_time = GENERATE(false, true);
    world.run(in_time ? 500 * ms : 300 * ms);
    world.reboot(wire::ResetCause::power_on);
    world.run(500 * ms);
    const std::size_t before = world.spi_imu().updates().period_ns > 1.5e6 ? 500 : 1000;
    CHECK(before == (in_time ? 1000 : 500));
}
