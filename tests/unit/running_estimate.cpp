// SPDX-License-Identifier: BSD-3-Clause
#include "engine/plausibility/running_estimate.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis;

TEST_CASE("running_estimate: the first value is believed, the next within the first tolerance") {
    RunningEstimate value(milliseconds(1));
    CHECK(value.fits(seconds(5)));
    value.learn(milliseconds(7));
    CHECK(value.fits(milliseconds(7) + microseconds(500)));
    CHECK_FALSE(value.fits(milliseconds(9)));
    CHECK(value.fits(milliseconds(8), milliseconds(1)));
}

TEST_CASE("running_estimate: an expected value needs no first one") {
    const RunningEstimate value(milliseconds(5), milliseconds(1));
    CHECK(value.fits(milliseconds(6)));
    CHECK_FALSE(value.fits(milliseconds(4) - microseconds(100)));
}

TEST_CASE("running_estimate: what a value scatters by is believed, and hardly more") {
    const double sigma_us = GENERATE(0.0, 5.0, 100.0);
    std::mt19937 random(7);
    std::normal_distribution<> noise(0, sigma_us);
    const auto draw = [&] {
        return milliseconds(3) + Duration{static_cast<std::int64_t>(1e3 * noise(random))};
    };
    RunningEstimate value(milliseconds(1));
    for (int i = 0; i < 200; ++i) value.learn(draw());
    int doubted = 0;
    for (int i = 0; i < 10'000; ++i) {
        const Duration honest = draw();
        if (!value.fits(honest)) ++doubted;
        value.learn(honest);
    }
    CHECK(doubted <= 5);
    CHECK(value.tolerance().ns <= 10'500 + 1e3 * 14 * sigma_us);
}

TEST_CASE("running_estimate: a drift is followed") {
    RunningEstimate value(milliseconds(1));
    Duration drifting = milliseconds(3);
    for (int i = 0; i < 1000; ++i, drifting = drifting + microseconds(1)) {
        CHECK(value.fits(drifting));
        value.learn(drifting);
    }
}

TEST_CASE("running_estimate: a bounded one is not led away, slowly or in steps") {
    const Duration each = GENERATE(nanoseconds(50), microseconds(1), microseconds(5));
    auto value = RunningEstimate(milliseconds(1)).within(microseconds(20));
    for (int i = 0; i < 200; ++i) value.learn(milliseconds(3));
    Duration drifting = milliseconds(3);
    for (int i = 0; i < 20'000; ++i, drifting = drifting + each)
        if (value.fits(drifting)) value.learn(drifting);
    CHECK_FALSE(value.fits(milliseconds(3) + microseconds(60)));
    CHECK(absolute(value.value() - milliseconds(3)) <= microseconds(20));
}

TEST_CASE("running_estimate: a bounded one learns what it scatters by at first") {
    std::mt19937 random(3);
    std::uniform_real_distribution<> us(-100, 100);
    auto value = RunningEstimate(milliseconds(1)).within(microseconds(20));
    int doubted = 0;
    for (int i = 0; i < 10'000; ++i) {
        const Duration honest = milliseconds(3) + nanoseconds(std::llround(1e3 * us(random)));
        if (!value.fits(honest)) ++doubted;
        value.learn(honest);
    }
    CHECK(doubted == 0);
}
