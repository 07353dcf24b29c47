// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_count.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis::client;

namespace {

double off(const LedReading& reading, double phase) {
    return std::abs(wrapped_steps(reading.phase - phase, reading.period));
}

}  // namespace

TEST_CASE("led_count: the levels of an exposure show its middle, whatever its length and order") {
    const double exposure = GENERATE(0.6, 0.97, 1.0, 1.3, 2.0, 2.7, 3.0);
    LedLayout layout;
    layout.backward = GENERATE(false, true);
    layout.high_bit_first = GENERATE(false, true);
    layout.binary_first = GENERATE(false, true);
    // Where a step is at the edge of an exposure, as little of it as noise may pass for.
    const double edge = exposure < 1 ? 0.08 : 1e-9;
    for (double start = 0; start < 64; start += 0.093) {
        const LedReading reading = read_leds(led_levels(start, exposure, layout), exposure, layout);
        INFO(start);
        REQUIRE_FALSE(reading.ambiguous);
        REQUIRE(off(reading, start + exposure / 2) <= reading.half_width + edge);
        REQUIRE(reading.half_width <= std::max(0.0, (1 - exposure) / 2) + 1e-9);
        REQUIRE(reading.residual < (exposure < 1 ? 0.04 : 1e-9));
    }
}

TEST_CASE("led_count: without a step within the exposure, the count alone is reported") {
    const LedReading reading = read_leds(led_levels(17.3, 0.5, {}), 0.5, {});
    CHECK(reading.phase == Approx(17.5));
    CHECK(reading.half_width == Approx(0.25));
    CHECK(read_leds(led_levels(17.6, 0.5, {}), 0.5, {}).half_width == 0);
}

TEST_CASE("led_count: while all bits change, a count is known up to 32 steps") {
    CHECK(read_leds(led_levels(31.5, 1, {}), 1, {}).period == 32);
    CHECK(read_leds(led_levels(63.5, 1, {}), 1, {}).period == 32);
    int halved = 0;
    for (double start = 0; start < 64; start += 0.01)
        if (read_leds(led_levels(start, 1, {}), 1, {}).period == 32) ++halved;
    CHECK(halved < 64);  // a hundredth of them
}

TEST_CASE("led_count: noise moves the phase by as much as it is worth, and seldom the count") {
    std::mt19937 random(5);
    std::normal_distribution<> noise(0, 0.05);
    double squares = 0;
    int read = 0;
    for (int i = 0; i < 500; ++i) {
        const double start = 64.0 * i / 500;
        LedLevels levels = led_levels(start, 1, {});
        for (double& level : levels) level += noise(random);
        const LedReading reading = read_leds(levels, 1, {});
        if (reading.ambiguous) continue;
        ++read;
        REQUIRE(off(reading, start + 0.5) < 0.3);
        squares += std::pow(off(reading, start + 0.5), 2);
    }
    CHECK(read > 490);
    CHECK(std::sqrt(squares / read) < 0.05);
}

TEST_CASE("led_count: what is not the board is ambiguous") {
    CHECK(read_leds({1, 1, 1, 1, 1, 1, 1, 1}, 1, {}).ambiguous);
    CHECK(read_leds({0, 0, 0, 0, 0, 0, 0, 0}, 1, {}).ambiguous);
    CHECK(read_leds({0.5, 0, 0.5, 0, 1, 0, 0, 0}, 1, {}).ambiguous);  // two that are no neighbours
    CHECK(read_leds({1, 0, 0, 0, 0.5, 0, 0, 0}, 1, {}).ambiguous);    // half a bit
}

TEST_CASE("led_count: differences are wrapped") {
    CHECK(wrapped_steps(63.5) == Approx(-0.5));
    CHECK(wrapped_steps(-63.5) == Approx(0.5));
    CHECK(wrapped_steps(6400.25) == Approx(0.25));
    CHECK(wrapped_steps(32) == -32);
    CHECK(wrapped_steps(32.25, 32) == Approx(0.25));
}
