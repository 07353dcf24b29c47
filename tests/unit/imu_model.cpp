// SPDX-License-Identifier: BSD-3-Clause
#include "engine/imu/imu_model.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;

TEST_CASE("imu_model: the ADIS16448's words in SI units") {
    const imu::ImuModel* model = imu::find_model("adis16448b");
    REQUIRE(model != nullptr);
    CHECK(model == imu::find_model(wire::ImuKind::adis16448b));
    wire::ImuSample sample{};
    sample.gyro[0] = 250;       // 10 deg/s
    sample.accel[2] = -1200;    // -1 g
    sample.magnetic[1] = 1000;  // 0.1429 gauss
    sample.pressure = 50662;    // 1013.24 mbar
    sample.temperature = 0;
    const ImuMetadata si = imu::to_si(*model, sample);
    CHECK(si.gyro[0] == Approx(10 * 3.14159265 / 180));
    CHECK(si.accel[2] == Approx(-9.80665));
    CHECK(si.magnetic[1] == Approx(1e-4 / 7));
    CHECK(si.pressure == Approx(101324));
    CHECK(si.temperature == Approx(31));
    CHECK(si.flags == 0);
}

TEST_CASE("imu_model: a failed check is passed on, an unknown part is not invented") {
    wire::ImuSample sample{};
    sample.flags = wire::imu_check_failed;
    CHECK((imu::to_si(*imu::find_model("adis16448b"), sample).flags & flag_sensor_error) != 0);
    CHECK(imu::find_model("mpu9250") == nullptr);
    CHECK(imu::find_model(wire::ImuKind::none) == nullptr);
}
