// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

constexpr std::uint8_t first_address = 0x68;

/// An ICM-42688-P wired for I2C at `address`, which the board looks for at the first one or, with
/// `second`, at the second.
devices::Icm42688pDevice& add_on_i2c(World& world, std::uint8_t address, bool second,
                                     double rate_hz = 1000) {
    auto device = std::make_unique<devices::Icm42688pDevice>(&World::motion);
    devices::Icm42688pDevice& part = *device;
    part.wire_i2c(address);
    world.add_imu(std::move(device), wire::ImuKind::icm42688p, rate_hz, true);
    world.configuration.imus[0].options |= wire::imu_i2c;
    if (second) world.configuration.imus[0].options |= wire::imu_i2c_second;
    return part;
}

bool on_grid(World& world) {
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1 && world.grid_error(record) != 0) return false;
    return true;
}

}  // namespace

TEST_CASE(
    "043-imu-i2c: at both addresses a part is set up, read and stamped as on the SPI, at 1 kHz") {
    const bool at_second = GENERATE(false, true);
    Scenario world;
    add_on_i2c(world, first_address + (at_second ? 1 : 0), at_second);
    world.add_camera(0);
    REQUIRE(world.begin());
    CHECK(world.inbox().answers.back().taken.imus[0].rate_millihertz == 1'000'000);
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& samples = world.inbox().samples[0];
    CHECK(samples.size() > 4800);
    for (const wire::ImuSample& sample : samples) {
        const unsigned overrun = world.is_slow() ? sample.flags & wire::imu_overrun : 0U;
        REQUIRE((sample.flags & ~wire::imu_repeated) == (wire::imu_stamped | overrun));
    }
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 1);
    CHECK(world.inbox().healths.back().imu_errors[0] == 0);
    CHECK(on_grid(world));
}

TEST_CASE(
    "043-imu-i2c-address: a part at another address is reported as silent, tried again every "
    "second, "
    "and sampled once it is there") {
    Scenario world;
    devices::Icm42688pDevice& part = add_on_i2c(world, first_address + 1, false);
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(5 * second);
    const auto silent = world.inbox().events_of(wire::BoardEventKind::imu_silent);
    CHECK(silent.size() >= 4);
    CHECK(silent.size() <= 6);
    CHECK(silent[0].detail == 0);  // the first step
    CHECK(world.inbox().samples[0].empty());
    part.wire_i2c(first_address);
    world.run(2 * second);
    world.finish();
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 1);
    CHECK(world.inbox().samples[0].size() > 800);
    world.drops_allowed = true;  // the time without it has no samples
    CHECK(world.judge() == "");
    CHECK(on_grid(world));
}

TEST_CASE(
    "043-imu-i2c-held: a bus that another part holds is reported, holds up nothing else, and is "
    "used "
    "again when it is released") {
    const Nanoseconds length = GENERATE(30 * ms, 3 * second);
    Scenario world;
    add_on_i2c(world, first_address, false);
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(2 * second);
    world.board().set_i2c_held(true);
    world.run(length);
    world.board().set_i2c_held(false);
    const std::size_t before = world.inbox().samples[0].size();
    world.run(3 * second);
    world.finish();
    // A reading that nobody acknowledged gives no sample, and its number is missing.
    CHECK(world.inbox().healths.back().imu_errors[0] >= 1);
    const auto& samples = world.inbox().samples[0];
    CHECK(samples.size() > before + 1800);
    CHECK(std::any_of(samples.begin() + static_cast<std::ptrdiff_t>(before), samples.end(),
                      [](const auto& sample) { return (sample.flags & wire::imu_overrun) != 0; }));
    const bool reported = !world.inbox().events_of(wire::BoardEventKind::imu_silent).empty();
    CHECK(reported == (length > second));  // a short one restarts nothing
    world.drops_allowed = true;            // the time without it has no samples
    CHECK(world.judge() == "");
    CHECK(on_grid(world));
}

TEST_CASE(
    "043-imu-i2c-unplugged: a part that comes off is reported and set up again when it is back") {
    Scenario world;
    devices::Icm42688pDevice& part = add_on_i2c(world, first_address, false, 500);
    REQUIRE(world.begin());
    world.run(2 * second);
    part.unplug(true);
    world.run(3 * second);
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_silent).size() >= 2);
    part.brown_out(world.now());
    part.unplug(false);
    const std::size_t before = world.inbox().samples[0].size();
    world.run(3 * second);
    CHECK(world.inbox().samples[0].size() > before + 900);
    world.drops_allowed = true;
    CHECK(world.judge() == "");
}

TEST_CASE("043-imu-i2c-options: what a part cannot do is refused, and said what it could") {
    struct Case {
        const char* what;
        wire::ImuKind kind;
        unsigned options;
        std::uint32_t rate_millihertz;
        wire::ConfigurationField field;
        std::int64_t maximum;
    };
    using Field = wire::ConfigurationField;
    constexpr unsigned paced = wire::imu_data_ready;
    const Case wrong = GENERATE(values<Case>({
        {"no I2C", wire::ImuKind::bmi088, paced | wire::imu_i2c, 400'000, Field::imu_options,
         paced},
        {"no I2C", wire::ImuKind::adis16448b, paced | wire::imu_i2c, 400'000, Field::imu_options,
         paced},
        {"too fast", wire::ImuKind::icm42688p, paced | wire::imu_i2c, 1'000'001, Field::imu_rate,
         1'000'000},
        {"not paced", wire::ImuKind::icm42688p, wire::imu_i2c, 100'000, Field::imu_options, 0},
        {"not on I2C", wire::ImuKind::icm42688p, paced | wire::imu_i2c_second, 400'000,
         Field::imu_options, paced},
        {"no such line", wire::ImuKind::icm42688p, paced | wire::imu_accel_ready, 400'000,
         Field::imu_options, paced},
        {"not paced", wire::ImuKind::bmi088, wire::imu_accel_ready, 400'000, Field::imu_options, 0},
    }));
    INFO(wrong.what << ", kind " << int(wrong.kind));
    Scenario world;
    world.connect();
    world.configuration.imus[0] = {wrong.kind, 0, static_cast<std::uint8_t>(wrong.options), 0,
                                   wrong.rate_millihertz};
    CHECK_FALSE(world.configure());
    REQUIRE(world.inbox().refusals.size() == 1);
    const wire::Refusal& refusal = world.inbox().refusals[0];
    CHECK(refusal.part == wire::ConfigurationPart::imu);
    CHECK(refusal.index == 0);
    CHECK(refusal.field == wrong.field);
    CHECK(refusal.maximum == wrong.maximum);
}
