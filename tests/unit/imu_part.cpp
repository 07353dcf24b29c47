// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_part.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::firmware;
using wire::ImuKind;

TEST_CASE("imu_part: what each kind is, and can do") {
    struct Facts {
        ImuKind kind;
        int identity;
        unsigned fastest, fastest_i2c, accel;
        int filter;
        Nanoseconds pause;
        unsigned readings;
    };
    const auto facts = GENERATE(values<Facts>({
        {ImuKind::adis16448b, 16448, 819'200, 0, 0, 6, 25'000, 1},
        {ImuKind::adis16448a, 16448, 819'200, 0, 0, 6, 25'000, 2},
        {ImuKind::adis16445, 16445, 819'200, 0, 0, 6, 25'000, 2},
        {ImuKind::adis16460, 16460, 2'048'000, 0, 0, 6, 16'000, 1},
        {ImuKind::adis16470, 16470, 2'000'000, 0, 0, 6, 16'000, 1},
        {ImuKind::icm42688p, 0x47, 8'000'000, 1'000'000, 0, 7, 0, 2},
        {ImuKind::bmi088, 0x0F1E, 2'000'000, 0, 1'600'000, 2, 0, 3},
    }));
    const ImuPart* part = find_part(facts.kind);
    REQUIRE(part != nullptr);
    CHECK(part->kind() == facts.kind);
    CHECK(part->identity() == facts.identity);
    CHECK(part->fastest_millihertz() == facts.fastest);
    CHECK(part->fastest_i2c_millihertz() == facts.fastest_i2c);
    CHECK(part->accel_millihertz() == facts.accel);
    CHECK(part->strongest_filter() == facts.filter);
    CHECK(part->pause() == facts.pause);
    CHECK(part->readings() == facts.readings);
    CHECK(part->readings() <= max_transfers);
    CHECK(part->rate(UINT32_MAX / 4) == facts.fastest);
}

TEST_CASE("imu_part: what is not on the SPI bus has no part") {
    CHECK(find_part(ImuKind::none) == nullptr);
    CHECK(find_part(ImuKind::vn100) == nullptr);
}

TEST_CASE("imu_part: the steps of a set-up, in order, as many as there is room for") {
    Setup setup;
    CHECK(setup.size() == 0);
    setup.write(1, 0x7C, 0x1234, 5'000);
    setup.expect(2, 0x10, 0x83);
    setup.write(0, 1, 2);
    REQUIRE(setup.size() == 3);
    CHECK(setup[0].action == SetupStep::Action::write);
    CHECK(setup[0].chip == 1);
    CHECK(setup[0].address == 0x7C);
    CHECK(setup[0].value == 0x1234);
    CHECK(setup[0].pause_us == 5'000);
    CHECK(setup[1].action == SetupStep::Action::expect);
    CHECK(setup[1].chip == 2);
    CHECK(setup[1].address == 0x10);
    CHECK(setup[1].value == 0x83);
    CHECK(setup[1].pause_us == 0);
    CHECK(setup[2].pause_us == 0);
    for (std::size_t i = 3; i < 20; ++i) {
        setup.write(0, static_cast<std::uint8_t>(i), 0);
        CHECK(setup.size() == i + 1);
    }
    setup.write(0, 0xFF, 0);
    CHECK(setup.size() == 20);
    CHECK(setup[19].address == 19);
}
