// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

constexpr unsigned bit_of(std::uint32_t present) {
    unsigned bit = 0;
    while (present >> bit != 1U) ++bit;
    return bit;
}

}  // namespace

TEST_CASE("042-small-board: what a board does not have is reported in hello, and refused by name",
          "[native]") {
    struct Use {
        std::uint32_t missing;
        void (*add)(World& world);
    };
    const Use use = GENERATE(
        Use{wire::present_camera0 << 2U, [](World& world) { world.add_camera(2); }},
        Use{wire::present_light,
            [](World& world) {
                world.add_camera(0);
                world.configuration.illumination = {1, 0, 0, 0, 10'000'000, 500'000};
            }},
        Use{wire::present_sync_output,
            [](World& world) {
                world.configuration.ports.sync_rate_uhz = 1'000'000;
                world.configuration.ports.pulse_ns = 100'000;
            }},
        Use{wire::present_test_output,
            [](World& world) {
                world.add_camera(0);
                world.configuration.ports.test = wire::test_camera0;
                world.configuration.ports.pulse_ns = 100'000;
            }},
        Use{wire::present_pulse0 << 1U,
            [](World& world) { world.configuration.ports.inputs = 1U << wire::pulse_aux0; }},
        Use{wire::present_spi,
            [](World& world) {
                world.add_imu(make_imu(wire::ImuKind::bmi088), wire::ImuKind::bmi088, 400, false);
            }},
        Use{wire::present_ready0,
            [](World& world) {
                world.add_imu(make_imu(wire::ImuKind::bmi088), wire::ImuKind::bmi088, 400, true);
            }},
        Use{wire::present_uart, [](World& world) { world.add_vn100(200, false); }},
        Use{wire::present_ready0 << 1U, [](World& world) { world.add_vn100(200, true); }},
        Use{wire::present_uart,
            [](World& world) { world.configuration.ports.options = wire::port_nmea; }},
        Use{wire::present_imu_output,
            [](World& world) {
                world.add_imu(make_imu(wire::ImuKind::bmi088), wire::ImuKind::bmi088, 400, true);
                world.configuration.ports.options = wire::port_imu_output;
            }},
        Use{wire::present_memory,
            [](World& world) { world.configuration.flags = wire::configuration_store; }});
    for (const bool missing : {false, true}) {
        firmware::PortModel model;
        if (missing) model.present &= ~use.missing;
        Scenario world(1, model);
        use.add(world);
        world.connect();
        CHECK(world.inbox().hellos[0].present == model.present);
        CHECK(world.inbox().hellos[0].cameras == ((use.missing & 0xFU) != 0 && missing ? 3 : 4));
        CHECK(world.configure() != missing);
        REQUIRE(world.inbox().refusals.size() == (missing ? 1 : 0));
        if (!missing) continue;
        const wire::Refusal& refusal = world.inbox().refusals[0];
        CHECK(refusal.field == wire::ConfigurationField::present);
        CHECK(refusal.value == bit_of(use.missing));
        CHECK(refusal.minimum > refusal.maximum);
    }
}

TEST_CASE("042-slow-board: the fastest IMU that it can read is reported, and is the limit",
          "[native]") {
    firmware::PortModel model;
    model.fastest_imu_millihertz = 2'000'000;
    Scenario world(1, model);
    world.add_imu(make_imu(wire::ImuKind::icm42688p), wire::ImuKind::icm42688p, 4000, true);
    world.connect();
    CHECK(world.inbox().hellos[0].fastest_imu_millihertz == 2'000'000);
    CHECK_FALSE(world.configure());
    REQUIRE(world.inbox().refusals.size() == 1);
    CHECK(world.inbox().refusals[0].field == wire::ConfigurationField::imu_rate);
    CHECK(world.inbox().refusals[0].maximum == 2'000'000);
}
