// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

void add_bmi088(World& world, double rate_hz) {
    world.add_imu(make_imu(wire::ImuKind::bmi088), wire::ImuKind::bmi088, rate_hz, true);
    world.configuration.imus[0].options |= wire::imu_accel_ready;
}

double stamped_part(const std::vector<wire::ImuSample>& samples, std::size_t from = 0) {
    const auto stamped = std::count_if(
        samples.begin() + static_cast<std::ptrdiff_t>(from), samples.end(),
        [](const auto& sample) { return (sample.flags & wire::imu_accel_stamped) != 0; });
    return static_cast<double>(stamped) / static_cast<double>(samples.size() - from);
}

}  // namespace

TEST_CASE(
    "044-accel-ready: an accelerometer with a clock of its own has its own stamps, by its own "
    "edges") {
    const double rate_hz = GENERATE(100.0, 400.0, 1000.0, 2000.0);
    INFO(rate_hz << " Hz");
    Scenario world;
    add_bmi088(world, rate_hz);
    REQUIRE(world.begin());
    world.run(5 * second);
    CHECK(world.judge() == "");  // each age is that of the values that were read
    const auto& samples = world.inbox().samples[0];
    CHECK(static_cast<double>(samples.size()) > 4.4 * rate_hz);
    // Of a hundred samples one is read while new values come, and does not say.
    CHECK(stamped_part(samples) > 0.97);
    std::int16_t youngest = INT16_MAX;
    std::int16_t oldest = INT16_MIN;
    for (const wire::ImuSample& sample : samples) {
        if ((sample.flags & wire::imu_accel_stamped) == 0) {
            REQUIRE(sample.accel_age == 0);
            continue;
        }
        youngest = std::min(youngest, sample.accel_age);
        oldest = std::max(oldest, sample.accel_age);
    }
    CHECK(oldest * 32 > 500 * us);  // the clocks drift through each other
    CHECK(oldest * 32 < 625 * us * 1.01);
    CHECK(youngest * 32 < 80 * us);
}

TEST_CASE("044-accel-ready-cut: without the wire no sample says how old its accelerometer is") {
    Scenario world;
    add_bmi088(world, 1000);
    world.set_accel_ready_wired(GENERATE(true, false));
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK(world.judge() == "");
    world.set_accel_ready_wired(false);
    world.run(ms);
    const std::size_t before = world.inbox().samples[0].size() + 2;  // on their way to the host
    world.run(2 * second);
    CHECK(world.inbox().samples[0].size() > before + 1900);
    CHECK(stamped_part(world.inbox().samples[0], before) == 0);
    for (const wire::ImuSample& sample : world.inbox().samples[0])
        REQUIRE((sample.flags & wire::imu_check_failed) == 0);
    world.set_accel_ready_wired(true);
    const std::size_t cut = world.inbox().samples[0].size() + 5;
    world.run(2 * second);
    CHECK(stamped_part(world.inbox().samples[0], cut) > 0.97);
    CHECK(world.judge() == "");
}

TEST_CASE("044-accel-ready-loose: an edge that did not arrive is not taken for the one before") {
    const bool often = GENERATE(false, true);  // every other edge is lost
    Scenario world;
    add_bmi088(world, 2000);
    REQUIRE(world.begin());
    world.run(second);
    for (int i = 0; i < 100; ++i) {
        world.set_accel_ready_wired(false);
        world.run(often ? 700 * us : 3 * ms);
        world.set_accel_ready_wired(true);
        world.run((often ? 600 * us : 7 * ms) + i * 13 * us);
    }
    CHECK(world.judge() == "");
    const double stamped = stamped_part(world.inbox().samples[0]);
    CHECK(stamped > 0.75);
    CHECK(stamped < 0.93);
}

TEST_CASE("044-accel-ready-not-asked: the part's line stays as it is after a reset") {
    Scenario world;
    world.add_imu(make_imu(wire::ImuKind::bmi088), wire::ImuKind::bmi088, 1000, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK_FALSE(world.spi_imu().accel_signals(world.now()));
    CHECK(stamped_part(world.inbox().samples[0]) == 0);
    CHECK(world.judge() == "");
}

TEST_CASE("044-accel-ready-lost: no age is of an edge before others that were lost", "[native]") {
    firmware::PortModel model;
    model.edges = 16;
    Scenario world(1, model);
    add_bmi088(world, 1000);
    REQUIRE(world.begin());
    world.run(second);
    for (int i = 0; i < 200; ++i) {
        world.stall_board(20 * ms + i * 7 * us);
        world.run(20 * ms);
    }
    CHECK(world.inbox().healths.back().lost_edges > 100);
    CHECK(world.judge() == "");
    CHECK(stamped_part(world.inbox().samples[0]) > 0.8);
}
