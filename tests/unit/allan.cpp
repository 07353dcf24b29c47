// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/allan.hpp"

#include <fmt/format.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <memory>
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

TEST_CASE("allan: lost samples and seconds are filled in while they are few", "[allan]") {
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
    for (int i = 0; i < 200; ++i) drop(2000);
    result = evaluate_allan(imu);
    REQUIRE(result);
    CHECK(density_of(result->gyro).value == Approx(2e-4).epsilon(0.02));
    for (int i = 0; i < 300; ++i) drop(2000);
    result = evaluate_allan(imu);
    REQUIRE_FALSE(result);
    CHECK_THAT(result.error().message(), Contains("503 of 20000 samples are missing"));
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

TEST_CASE("allan: single spikes are taken off, many are refused", "[allan]") {
    RestingImu imu = resting(100, 4e-5, 4e-4);
    imu.gyro[0][5000] = 3;
    imu.gyro[0][5001] = 3;
    imu.accel[2][12345] = -160;
    auto result = evaluate_allan(imu);
    REQUIRE(result);
    CHECK(result->spikes == 3);
    CHECK(density_of(result->gyro).value == Approx(2e-4).epsilon(0.02));
    CHECK(density_of(result->accel).value == Approx(2e-3).epsilon(0.02));
    for (std::size_t i = 100; i < 20'000; i += 100) imu.accel[1][i] = 50;
    result = evaluate_allan(imu);
    REQUIRE_FALSE(result);
    CHECK_THAT(result.error().message(), Contains("202 values are far off") && Contains("cable"));
}

TEST_CASE("allan: a part that is read more often than it measures has the same noise", "[allan]") {
    RestingImu imu = resting(400, 4e-5, 4e-4);
    for (auto* axes : {&imu.gyro, &imu.accel})
        for (auto& axis : *axes)
            for (std::size_t i = 1; i < axis.size(); i += 2) axis[i] = axis[i - 1];
    const auto result = evaluate_allan(imu);
    REQUIRE(result);
    CHECK(density_of(result->gyro).value == Approx(2e-4 * std::sqrt(2.0)).epsilon(0.05));
}

namespace {

constexpr double hour_rate_hz = 100;
constexpr double hour_s = 3600;

/// An hour at rest, with what is added to the bias at a time in seconds.
std::vector<float> hour_at_rest(unsigned seed, const std::function<double(double)>& added,
                                double walk = 4e-5) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<float> rates;
    double bias = 0.02;
    for (double at_s = 0; at_s < hour_s; at_s += 1 / hour_rate_hz) {
        bias += walk / std::sqrt(hour_rate_hz) * normal(random);
        rates.push_back(static_cast<float>(bias + added(at_s) +
                                           2e-4 * std::sqrt(hour_rate_hz) * normal(random)));
    }
    return rates;
}

/// Flicker noise of this instability, as processes of time constants from 1 to 2000 s.
std::function<double(double)> flicker(unsigned seed, double instability) {
    struct State {
        std::mt19937_64 random;
        std::normal_distribution<double> normal;
        std::array<double, 12> processes{};
    };
    auto state = std::make_shared<State>();
    state->random.seed(seed);
    return [state, instability](double /*at_s*/) {
        double sum = 0;
        double constant_s = 1;
        for (double& one : state->processes) {
            const double kept = std::exp(-1 / hour_rate_hz / constant_s);
            one = kept * one + std::sqrt(1 - kept * kept) * state->normal(state->random);
            sum += one;
            constant_s *= 2;
        }
        return instability * sum;
    };
}

struct HostileScene {
    const char* name;
    std::function<double(double)> added;
    double walk = 4e-5;
    bool smooth = false;  ///< a random walk is not to be given
};

}  // namespace

TEST_CASE("allan: a bias that drifts, settles or follows a temperature", "[statistics]") {
    constexpr unsigned runs = 20;
    const auto settling = [](double amount, double constant_s) {
        return [=](double at_s) { return amount * std::exp(-at_s / constant_s); };
    };
    const auto wave = [](double amount, double period_s) {
        return [=](double at_s) { return amount * std::sin(2 * M_PI * at_s / period_s); };
    };
    const std::vector<HostileScene> scenes{
        {"a random walk alone", [](double /*at_s*/) { return 0; }},
        {"a hardly visible one", [](double /*at_s*/) { return 0; }, 4e-6},
        {"warming up for half an hour", settling(3e-3, 1800), 4e-6},
        {"warming up for five minutes", settling(-5e-3, 300)},
        {"a slow drift", [](double at_s) { return 2e-6 * at_s; }},
        {"an air condition", wave(1e-3, 900), 4e-6, true},
        {"a shadow in the morning", wave(5e-3, 2500), 4e-6, true},
    };
    for (const HostileScene& scene : scenes) {
        CAPTURE(scene.name);
        unsigned refused = 0;
        unsigned walks = 0;
        double walk_square = 0;
        double density_square = 0;
        unsigned beyond = 0;
        for (unsigned seed = 0; seed < runs; ++seed) {
            const auto axis =
                axis_noise(hour_at_rest(seed, scene.added, scene.walk), 1 / hour_rate_hz);
            REQUIRE(axis);
            density_square += std::pow((axis->density.value - 2e-4) / axis->density.sigma, 2);
            refused += axis->smooth ? 1 : 0;
            if (!axis->smooth && axis->walk_limit < scene.walk) ++beyond;
            if (!axis->walk) continue;
            ++walks;
            walk_square += std::pow((axis->walk->value - scene.walk) / axis->walk->sigma, 2);
        }
        WARN(
            fmt::format("{}: {} of {} refused; {} walks, NEES {:.2f}; NEES of densities {:.2f}; "
                        "{} limits too low",
                        scene.name, refused, runs, walks, walks > 0 ? walk_square / walks : 0,
                        density_square / runs, beyond));
        CHECK(density_square / runs < 2);
        if (scene.smooth) {
            CHECK(refused >= runs - 1);
        } else {
            CHECK(refused <= 1);
            CHECK(beyond <= 3);
            if (walks > 0) CHECK(walk_square / walks < 2.5);
        }
    }
}

TEST_CASE("allan: flicker noise is neither a drift nor smooth", "[statistics]") {
    unsigned refused = 0;
    unsigned drifts = 0;
    for (unsigned seed = 0; seed < 20; ++seed) {
        const double instability = seed % 2 == 0 ? 2e-5 : 2e-4;
        const auto axis = axis_noise(hour_at_rest(seed, flicker(seed + 100, instability), 4e-6),
                                     1 / hour_rate_hz);
        REQUIRE(axis);
        refused += axis->smooth ? 1 : 0;
        drifts += axis->drift ? 1 : 0;
    }
    CHECK(refused <= 1);
    CHECK(drifts <= 2);
}
