// SPDX-License-Identifier: BSD-3-Clause
#include <tuple>

#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

struct Part {
    const char* name;
    wire::ImuKind kind;
    double rate_hz;
    double true_rate_hz;  ///< with data-ready
};

/// A sample like the one before is flagged, and nothing else is wrong.
std::uint16_t expected_flags(const std::vector<wire::ImuSample>& samples, std::size_t i,
                             unsigned flags) {
    const auto words = [](const wire::ImuSample& sample) {
        return std::tie(sample.gyro[0], sample.gyro[1], sample.gyro[2], sample.accel[0],
                        sample.accel[1], sample.accel[2]);
    };
    const bool repeated = i > 0 && words(samples[i]) == words(samples[i - 1]);
    return static_cast<std::uint16_t>(repeated ? flags | wire::imu_repeated : flags);
}

}  // namespace

TEST_CASE(
    "023-imus: every part is set up, read and checked as its data sheet says, stamped by its own "
    "edges") {
    const Part part = GENERATE(values<Part>({
        {"adis16445", wire::ImuKind::adis16445, 200, 204.8},
        {"adis16448a", wire::ImuKind::adis16448a, 400, 409.6},
        {"adis16448b", wire::ImuKind::adis16448b, 819.2, 819.2},
        {"adis16460", wire::ImuKind::adis16460, 500, 512},
        {"adis16470", wire::ImuKind::adis16470, 2000, 2000},
        {"icm42688p", wire::ImuKind::icm42688p, 4000, 4000},
        {"bmi088", wire::ImuKind::bmi088, 1000, 1000},
    }));
    INFO(part.name);
    Scenario world;
    world.add_imu(make_imu(part.kind), part.kind, part.rate_hz, true);
    REQUIRE(world.begin());
    CHECK(world.inbox().answers.back().taken.imus[0].rate_millihertz ==
          std::lround(part.true_rate_hz * 1000));
    world.run(5 * second);
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 1);
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_failed).empty());
    const auto& samples = world.inbox().samples[0];
    CHECK(static_cast<double>(samples.size()) == Approx(4.4 * part.true_rate_hz).epsilon(0.08));
    for (std::size_t i = 0; i < samples.size(); ++i) {
        // A port that is too slow for the part says so.
        const unsigned overrun = world.is_slow() ? samples[i].flags & wire::imu_overrun : 0U;
        REQUIRE(samples[i].flags == expected_flags(samples, i, wire::imu_stamped | overrun));
    }
}

TEST_CASE("023-imus-filters: a sample shows the motion of the filter's delay before") {
    const Part part = GENERATE(values<Part>({
        {"adis16445", wire::ImuKind::adis16445, 102.4, 102.4},
        {"adis16448a", wire::ImuKind::adis16448a, 200, 204.8},
        {"adis16448b", wire::ImuKind::adis16448b, 819.2, 819.2},
        {"adis16460", wire::ImuKind::adis16460, 500, 512},
        {"adis16470", wire::ImuKind::adis16470, 100, 100},
    }));
    const std::uint8_t filter = GENERATE(std::uint8_t{0}, std::uint8_t{2}, std::uint8_t{4});
    INFO(part.name << ", filter " << int(filter));
    Scenario world;
    world.add_imu(make_imu(part.kind), part.kind, part.rate_hz, true);
    world.configuration.imus[0].filter = filter;
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK(world.judge() == "");
    CHECK(world.inbox().samples[0].size() > part.true_rate_hz);
}

TEST_CASE("023-imus-without-data-ready: every part is read on the board's grid") {
    const wire::ImuKind kind = GENERATE(
        values({wire::ImuKind::adis16445, wire::ImuKind::adis16448a, wire::ImuKind::adis16448b,
                wire::ImuKind::adis16460, wire::ImuKind::adis16470, wire::ImuKind::icm42688p,
                wire::ImuKind::bmi088}));
    INFO(int(kind));
    Scenario world;
    world.add_imu(make_imu(kind), kind, 200, false);
    REQUIRE(world.begin());
    world.run(5 * second);
    CHECK(world.judge() == "");
    const auto& samples = world.inbox().samples[0];
    CHECK(samples.size() > 850);
    for (std::size_t i = 1; i < samples.size(); ++i) {
        // A part that is read until two readings agree may need three.
        REQUIRE(std::abs(samples[i].time_ns - samples[i - 1].time_ns - 5 * ms) < 300 * us);
        REQUIRE(samples[i].flags == expected_flags(samples, i, 0));
    }
}
