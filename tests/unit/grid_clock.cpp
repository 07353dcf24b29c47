// SPDX-License-Identifier: BSD-3-Clause
#include "grid_clock.hpp"

#include <catch2/catch.hpp>

using namespace versavis::firmware;

namespace {
constexpr Nanoseconds second = 1'000'000'000;
}

TEST_CASE("grid_clock: what lies before a board time is found, whatever the pace") {
    GridClock clock;
    clock.begin(5 * second, second);
    REQUIRE(clock.sync_pulse(6 * second + 300'000));
    for (const Nanoseconds at : {6 * second, 100 * second, 100'000 * second}) {
        CHECK(clock.board_time(clock.grid_time(at)) <= at);
        CHECK(clock.board_time(clock.grid_time(at)) >= at - at / 500'000 - 10);
    }
}

TEST_CASE("grid_clock: without pulses grid time passes as board time does") {
    GridClock clock;
    clock.begin(5 * second, 0);
    CHECK(clock.board_time(0) == 5 * second);
    CHECK(clock.board_time(100'000 * second) == 100'005 * second);
    CHECK_FALSE(clock.sync_pulse(6 * second));
}

TEST_CASE("grid_clock: it takes the pace of the pulses, over gaps, and refuses what is none of them") {
    GridClock clock;
    clock.begin(5 * second, second);
    CHECK(clock.sync_pulse(6 * second + 50'000));  // 50 ppm slower than here
    CHECK(clock.board_time(second) == 6 * second + 50'000);
    CHECK(clock.board_time(second + second / 2) == 6 * second + second / 2 + 75'000);
    CHECK_FALSE(clock.sync_pulse(6 * second + 700'000'000));
    CHECK(clock.sync_pulse(9 * second + 200'000));
    CHECK(clock.board_time(4 * second) == 9 * second + 200'000);
    CHECK(clock.board_time(5 * second) == 10 * second + 250'000);
}
