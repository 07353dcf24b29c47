// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/allan.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

constexpr double imu_rate_hz = 200;

std::vector<float> noise(std::size_t count, double density, double walk, unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<float> rates;
    double bias = 0.02;
    for (std::size_t i = 0; i < count; ++i) {
        bias += walk / std::sqrt(imu_rate_hz) * normal(random);
        rates.push_back(
            static_cast<float>(bias + density * std::sqrt(imu_rate_hz) * normal(random)));
    }
    return rates;
}

/// By the definition: half the mean square of the differences of neighbouring means.
double naive_deviation(const std::vector<float>& rates, std::size_t m) {
    const auto mean = [&](std::size_t from) {
        double sum = 0;
        for (std::size_t i = from; i < from + m; ++i) sum += rates[i];
        return sum / static_cast<double>(m);
    };
    double total = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i + 2 * m <= rates.size(); ++i, ++count)
        total += std::pow(mean(i + m) - mean(i), 2);
    return std::sqrt(total / (2 * static_cast<double>(count)));
}

RestingImu resting(double seconds, double gyro_walk, double accel_walk) {
    RestingImu imu;
    imu.name = "imu0";
    const auto count = static_cast<std::size_t>(seconds * imu_rate_hz);
    for (std::size_t i = 0; i < count; ++i)
        imu.times.push_back({static_cast<std::int64_t>(i) * 5'000'000});
    for (unsigned axis = 0; axis < 3; ++axis) {
        imu.gyro[axis] = noise(count, 2e-4, gyro_walk, 1 + axis);
        imu.accel[axis] = noise(count, 2e-3, accel_walk, 11 + axis);
    }
    return imu;
}

}  // namespace

TEST_CASE("allan: the deviation is that of the definition", "[allan]") {
    const auto rates = noise(700, 2e-3, 1e-2, 5);
    const auto points = allan_deviation(rates, 1 / imu_rate_hz);
    REQUIRE(points.size() == 8);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::size_t m = std::size_t{1} << i;
        CHECK(points[i].tau_s == Approx(static_cast<double>(m) / imu_rate_hz));
        CHECK(points[i].deviation == Approx(naive_deviation(rates, m)).epsilon(1e-6));
    }
}

TEST_CASE("allan: too few rates have no deviation", "[allan]") {
    CHECK(allan_deviation(std::vector<float>(2), 0.1).empty());
    CHECK_FALSE(axis_noise(std::vector<float>(2), 0.1));
    CHECK_FALSE(axis_noise(std::vector<float>(5000, 0.5F), 0.1));
}

TEST_CASE("allan: density and walk of simulated noise, and honest sigmas", "[statistics]") {
    constexpr int runs = 60;
    double density_square = 0;
    double walk_square = 0;
    for (unsigned seed = 0; seed < runs; ++seed) {
        const auto axis = axis_noise(noise(200'000, 2e-4, 4e-5, seed), 1 / imu_rate_hz);
        REQUIRE(axis);
        CHECK(axis->density.value == Approx(2e-4).epsilon(0.02));
        REQUIRE(axis->walk);
        CHECK(axis->walk->value == Approx(4e-5).epsilon(0.6));
        CHECK(axis->walk_limit > axis->walk->value);
        density_square += std::pow((axis->density.value - 2e-4) / axis->density.sigma, 2);
        walk_square += std::pow((axis->walk->value - 4e-5) / axis->walk->sigma, 2);
    }
    // The mean square of 60 errors in sigmas scatters by 0.18.
    CAPTURE(density_square / runs, walk_square / runs);
    CHECK(density_square / runs > 0.4);
    CHECK(density_square / runs < 1.6);
    CHECK(walk_square / runs > 0.4);
    CHECK(walk_square / runs < 1.6);
}

TEST_CASE("allan: the limit of a walk that is not seen holds, and what it needs shows it",
          "[allan]") {
    int above = 0;
    for (unsigned seed = 0; seed < 40; ++seed) {
        const auto axis = axis_noise(noise(20'000, 2e-4, 1e-5, 100 + seed), 1 / imu_rate_hz);
        REQUIRE(axis);
        if (axis->walk_limit < 1e-5) ++above;
        if (axis->walk) continue;
        CHECK(axis->walk_needs_s > 100);
    }
    CHECK(above <= 4);
    const auto axis = axis_noise(noise(20'000, 2e-4, 0, 7), 1 / imu_rate_hz);
    REQUIRE(axis);
    REQUIRE_FALSE(axis->walk);
    const auto longer = static_cast<std::size_t>(2 * axis->walk_needs_s * imu_rate_hz);
    int shown = 0;
    for (unsigned seed = 0; seed < 4; ++seed) {
        const auto long_axis =
            axis_noise(noise(longer, 2e-4, axis->walk_limit, seed), 1 / imu_rate_hz);
        REQUIRE(long_axis);
        if (long_axis->walk) ++shown;
    }
    CHECK(shown >= 3);
}

TEST_CASE("allan: a filter's shoulder is left out", "[allan]") {
    const auto raw = noise(200'000, 2e-4, 4e-5, 3);
    std::vector<float> filtered;
    for (std::size_t i = 16; i < raw.size(); ++i) {
        float sum = 0;
        for (std::size_t k = i - 16; k < i; ++k) sum += raw[k];
        filtered.push_back(sum / 16);
    }
    const auto axis = axis_noise(filtered, 1 / imu_rate_hz);
    REQUIRE(axis);
    CHECK(axis->density.value == Approx(2e-4).epsilon(0.09));
}

TEST_CASE("allan: an IMU at rest gives Kalibr's values", "[allan]") {
    const auto result = evaluate_allan(resting(1000, 4e-5, 4e-4));
    REQUIRE(result);
    CHECK(result->rate_hz == Approx(imu_rate_hz));
    CHECK(density_of(result->gyro).value == Approx(2e-4).epsilon(0.02));
    CHECK(density_of(result->accel).value == Approx(2e-3).epsilon(0.02));
    REQUIRE(walk_of(result->gyro));
    CHECK(walk_of(result->gyro)->value == Approx(4e-5).epsilon(0.4));
    const auto yaml = kalibr_imu_yaml(*result, "/imu0/data_raw");
    REQUIRE(yaml);
    CHECK_THAT(*yaml, Contains("\ngyroscope_noise_density: ") &&
                          Contains("\nrostopic: /imu0/data_raw\nupdate_rate: 200.000\n"));
}

TEST_CASE("allan: a recording too short for the walk says how long is needed", "[allan]") {
    const auto result = evaluate_allan(resting(60, 1e-6, 1e-5));
    REQUIRE(result);
    CHECK(walk_needs_s(*result) > 60);
    const auto yaml = kalibr_imu_yaml(*result, "/imu0/data_raw");
    REQUIRE_FALSE(yaml);
    CHECK_THAT(yaml.error().message(), Contains("too short") && Contains("record at least"));
}

TEST_CASE("allan: lost samples are interpolated while they are few", "[allan]") {
    RestingImu imu = resting(100, 4e-5, 4e-4);
    const auto drop = [&](std::size_t at) {
        imu.times.erase(imu.times.begin() + static_cast<std::ptrdiff_t>(at));
        for (auto* axes : {&imu.gyro, &imu.accel})
            for (auto& axis : *axes) axis.erase(axis.begin() + static_cast<std::ptrdiff_t>(at));
    };
    drop(1000);
    drop(1000);
    drop(5000);
    auto result = evaluate_allan(imu);
    REQUIRE(result);
    CHECK(result->missing == 3);
    CHECK(result->rate_hz == Approx(imu_rate_hz));
    for (int i = 0; i < 30; ++i) drop(2000);
    result = evaluate_allan(imu);
    REQUIRE_FALSE(result);
    CHECK_THAT(result.error().message(), Contains("33 of 20000 samples are missing"));
}

TEST_CASE("allan: motion is reported with its time", "[allan]") {
    RestingImu imu = resting(60, 4e-5, 4e-4);
    for (std::size_t i = 0; i < 100; ++i) imu.gyro[1][8250 + i] += i % 40 < 20 ? 0.1F : -0.1F;
    const auto result = evaluate_allan(imu);
    REQUIRE_FALSE(result);
    CHECK_THAT(result.error().message(), Contains("moved 41 s after the start"));
}

TEST_CASE("allan: a few samples are refused", "[allan]") {
    CHECK_FALSE(evaluate_allan({}));
    const auto result = evaluate_allan(resting(3, 0, 0));
    REQUIRE_FALSE(result);
    CHECK_THAT(result.error().message(), Contains("too few"));
}
