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

TEST_CASE("imu_model: data that repeat, and how old the acceleration is, are passed on") {
    const imu::ImuModel& model = *imu::find_model("bmi088");
    wire::ImuSample sample{};
    sample.accel_age = 100;  // without its flag it says nothing
    CHECK(imu::to_si(model, sample).accel_age_ns == 0);
    CHECK(imu::to_si(model, sample).flags == 0);
    sample.flags = wire::imu_repeated;
    CHECK(imu::to_si(model, sample).flags == flag_repeated);
    sample.flags = wire::imu_accel_stamped;
    CHECK(imu::to_si(model, sample).flags == flag_accel_age);
    CHECK(imu::to_si(model, sample).accel_age_ns == 3'200);
    sample.accel_age = -0x8000;  // it came after the angular rate
    CHECK(imu::to_si(model, sample).accel_age_ns == -1'048'576);
}

namespace {

double delay_ms(const char* name, unsigned filter, double rate_hz, bool data_ready) {
    const auto delay = imu::filter_delay(*imu::find_model(name), filter, rate_hz, data_ready);
    CHECK(delay.source == imu::FilterDelaySource::model);
    CHECK(delay.sigma.ns > 0);
    return static_cast<double>(delay.delay.ns) * 1e-6;
}

}  // namespace

TEST_CASE("imu_model: the filter's delay by part, strength and rate") {
    constexpr double element = 0.394 + 0.210;  // poles of 404 and 757 Hz
    // Read on the board's grid, the part runs as fast as it can, and half a period of that is the
    // mean age of what is read.
    CHECK(delay_ms("adis16448b", 0, 200, false) == Approx(element + 0.610).margin(0.003));
    CHECK(delay_ms("adis16448b", 2, 200, false) == Approx(element + 3.662 + 0.610).margin(0.003));
    CHECK(delay_ms("adis16448a", 4, 200, false) == Approx(element + 18.311 + 0.610).margin(0.003));
    CHECK(delay_ms("adis16448a", 0, 100, false) == Approx(element + 1.5 / 0.8192).margin(0.003));
    CHECK(delay_ms("adis16470", 0, 1000, false) == Approx(0.364 + 0.25).margin(0.001));
    // Paced by itself it also averages the four samples that make one of its output.
    CHECK(delay_ms("adis16448b", 0, 200, true) == Approx(element + 1.5 / 0.8192).margin(0.003));
    CHECK(delay_ms("adis16445", 2, 819.2, true) == Approx(element + 3.662).margin(0.003));
    CHECK(delay_ms("adis16460", 3, 2048, true) == Approx(0.533 + 7 / 2.048).margin(0.001));
    CHECK(delay_ms("adis16460", 0, 512, true) == Approx(0.533 + 1.5 / 2.048).margin(0.001));
    CHECK(delay_ms("adis16470", 6, 2000, true) == Approx(0.364 + 63 / 2.0).margin(0.001));
    CHECK(delay_ms("adis16470", 1, 100, true) == Approx(0.364 + (1 + 9.5) / 2.0).margin(0.001));
}

TEST_CASE("imu_model: what VersaVIS published of the ADIS16448 is explained to 0.4 ms") {
    const std::pair<unsigned, double> published[] = {{0, 1.55}, {2, 5.26}, {4, 19.95}};
    for (const auto& [filter, offset_ms] : published) {
        CAPTURE(filter);
        CHECK(delay_ms("adis16448b", filter, 200, false) == Approx(offset_ms).margin(0.44));
    }
}

TEST_CASE("imu_model: the ICM-42688-P delays as its data sheet's table says") {
    // DS-000347 1.8, group delay with filters of second order, in ms; then the anti-alias filter.
    struct Row {
        double rate_hz;
        double delay_ms[8];
    };
    const Row rows[] = {{8000, {0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2}},
                        {2000, {0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8}},
                        {1000, {0.7, 2.1, 2.4, 3.2, 3.7, 5.2, 6.1, 12.0}},
                        {500, {1.3, 4.1, 4.7, 6.4, 7.3, 10.4, 12.2, 24.0}},
                        {200, {3.3, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0}},
                        {100, {6.5, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0}},
                        {50, {12.9, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0}},
                        {12.5, {25.7, 5.1, 5.8, 8.0, 9.1, 12.9, 15.3, 30.0}}};
    constexpr double alias_ms = 0.385;
    for (const Row& row : rows)
        for (unsigned filter = 0; filter < 8; ++filter) {
            CAPTURE(row.rate_hz, filter);
            CHECK(delay_ms("icm42688p", filter, row.rate_hz, true) ==
                  Approx(row.delay_ms[filter] + alias_ms).margin(0.11));
        }
    // It runs at a rate that it has: here 500 Hz.
    CHECK(delay_ms("icm42688p", 0, 300, true) == delay_ms("icm42688p", 0, 500, true));
}

TEST_CASE("imu_model: what the board reads on its own grid may be new or old, and sigma says so") {
    const imu::ImuModel& adis = *imu::find_model("adis16448b");
    const Duration paced = imu::filter_delay(adis, 2, 819.2, true).sigma;
    const Duration unpaced = imu::filter_delay(adis, 2, 819.2, false).sigma;
    CHECK(paced > microseconds(100));
    CHECK(paced < microseconds(200));
    CHECK(static_cast<double>(unpaced.ns) ==
          Approx(std::hypot(static_cast<double>(paced.ns), 1e9 / 819.2 / std::sqrt(12))));
    // That of a filter nobody states stays unknown; the age does not.
    const imu::ImuModel& bmi = *imu::find_model("bmi088");
    const double filter_ns = 0.3 / 116 * 1e9, period_ns = 1e9 / 800;
    const auto delay = imu::filter_delay(bmi, 0, 200, false);
    CHECK(delay.source == imu::FilterDelaySource::unknown);
    CHECK(static_cast<double>(delay.delay.ns) == Approx(period_ns / 2));
    CHECK(static_cast<double>(delay.sigma.ns) ==
          Approx(std::hypot(filter_ns, period_ns / std::sqrt(12))));
}

TEST_CASE("imu_model: a delay that was measured is taken as it is") {
    const imu::ImuModel& adis = *imu::find_model("adis16460");
    const auto paced = imu::measured_delay(adis, 200, true, microseconds(2500));
    CHECK(paced.delay == microseconds(2500));
    CHECK(paced.sigma.ns == 0);
    CHECK(paced.source == imu::FilterDelaySource::configuration);
    const auto unpaced = imu::measured_delay(adis, 200, false, microseconds(2500));
    CHECK(unpaced.delay == microseconds(2500));
    CHECK(static_cast<double>(unpaced.sigma.ns) == Approx(2 / 2048.0 / std::sqrt(12) * 1e9));
}

TEST_CASE("imu_model: a filter whose delay nobody states is not guessed, and sigma says so") {
    for (const char* name : {"bmi088", "vn100"}) {
        const auto delay = imu::filter_delay(*imu::find_model(name), 0, 200, true);
        CHECK(delay.delay.ns == 0);
        CHECK(delay.source == imu::FilterDelaySource::unknown);
        CHECK(delay.sigma > milliseconds(1));
        CHECK(delay.sigma < milliseconds(10));
    }
}
