// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

struct Part {
    const char* name;
    wire::ImuKind kind;
    double rate_hz;
};

}  // namespace

TEST_CASE(
    "046-ready-echo: echoes of a data-ready line are counted, and neither samples nor restarts") {
    const Part part = GENERATE(values<Part>({
        {"adis16448b", wire::ImuKind::adis16448b, 819.2},
        {"adis16470", wire::ImuKind::adis16470, 2000},
        {"icm42688p", wire::ImuKind::icm42688p, 1000},
        {"icm42688p", wire::ImuKind::icm42688p, 4000},
        {"bmi088", wire::ImuKind::bmi088, 400},
    }));
    const Nanoseconds echo = GENERATE(300, 30 * us);
    INFO(part.name << " at " << part.rate_hz << " Hz, echo after " << echo << " ns");
    Scenario world;
    world.add_imu(make_imu(part.kind), part.kind, part.rate_hz, true);
    if (part.kind == wire::ImuKind::bmi088)
        world.configuration.imus[0].options |= wire::imu_accel_ready;
    world.set_ready_echo(echo);
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() ==
          "");  // each sample is right, stamped by a true edge, and none is missing
    const auto& samples = world.inbox().samples[0];
    CHECK(static_cast<double>(samples.size()) == Approx(5 * part.rate_hz).epsilon(0.1));
    // The newest health is up to a second old.
    CHECK(world.inbox().healths.back().glitches > 4 * part.rate_hz);
    CHECK(world.inbox().healths.back().imu_errors[0] == 0);
    CHECK(world.inbox().healths.back().imu_restarts == 0);
}

TEST_CASE("046-ready-echo-i2c: a reading that takes longer than the echo is none the worse") {
    const Nanoseconds echo = GENERATE(300, 30 * us);
    Scenario world;
    auto device = std::make_unique<devices::Icm42688pDevice>(&World::motion);
    device->wire_i2c(0x68);
    world.add_imu(std::move(device), wire::ImuKind::icm42688p, 1000, true);
    world.configuration.imus[0].options |= wire::imu_i2c;
    world.set_ready_echo(echo);
    REQUIRE(world.begin());
    world.run(5 * second);
    CHECK(world.judge() == "");
    CHECK(world.inbox().samples[0].size() > 4600);
    CHECK(world.inbox().healths.back().glitches > 4000);
    CHECK(world.inbox().healths.back().imu_restarts == 0);
}

TEST_CASE("046-ready-lost: after lost edges the numbers go on, and no stamp is another's",
          "[native]") {
    const Part part = GENERATE(values<Part>({
        {"adis16448b", wire::ImuKind::adis16448b, 819.2},
        {"adis16445", wire::ImuKind::adis16445, 200},
        {"icm42688p", wire::ImuKind::icm42688p, 2000},
    }));
    INFO(part.name);
    firmware::PortModel model;
    model.edges = 8;
    Scenario world(1, model);
    world.add_imu(make_imu(part.kind), part.kind, part.rate_hz, true);
    REQUIRE(world.begin());
    world.run(second);
    const std::uint32_t lost = world.inbox().healths.back().lost_edges;
    std::size_t before = 0;
    for (int i = 0; i < 20; ++i) {
        before = world.inbox().samples[0].size();
        world.stall_board(50 * ms + i * 100 * us);
        world.run(50 * ms);
        const auto& samples = world.inbox().samples[0];
        REQUIRE(samples.size() > before);
        const bool reported =
            std::any_of(samples.begin() + static_cast<std::ptrdiff_t>(before), samples.end(),
                        [](const auto& sample) { return (sample.flags & wire::imu_overrun) != 0; });
        REQUIRE(reported);
    }
    world.run(second);
    CHECK(world.inbox().healths.back().lost_edges > lost);
    CHECK(world.judge() == "");  // the numbers are those of the edges
}

TEST_CASE("046-ready-late: after a stall the next reading begins with its data, not in the middle",
          "[native]") {
    // On I2C a reading that begins late would last until the data after it.
    Scenario world;
    auto device = std::make_unique<devices::Icm42688pDevice>(&World::motion);
    device->wire_i2c(0x68);
    world.add_imu(std::move(device), wire::ImuKind::icm42688p, 1000, true);
    world.configuration.imus[0].options |= wire::imu_i2c;
    REQUIRE(world.begin());
    world.run(second);
    for (int i = 0; i < 200; ++i) {
        world.stall_board(2 * ms + i * 10 * us);
        world.run(10 * ms);
    }
    world.run(second);
    CHECK(world.judge() == "");
    CHECK(world.inbox().samples[0].size() > 2500);
    CHECK(world.inbox().healths.back().imu_restarts == 0);
}
