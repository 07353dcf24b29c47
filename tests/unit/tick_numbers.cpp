// SPDX-License-Identifier: BSD-3-Clause
#include "board/tick_numbers.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("tick_numbers: no tick of a later grid is one of an earlier") {
    // The fastest camera, whose board's clock is as fast as may be; the host hears of each grid
    // sooner or later after it began.
    const Duration heard_after[] = {milliseconds(1), seconds(9), milliseconds(5), seconds(2)};
    TickNumbers numbers;
    std::uint64_t newest = 0;
    HostTime begins{5'000'000'000};
    for (const Duration delay : heard_after)
        for (const Duration lasts : {seconds(12), seconds(3600), seconds(10)}) {
            numbers.grid_began(begins + delay);
            CHECK((newest == 0 || numbers.number(0, 0) > newest));
            newest = numbers.number(0, static_cast<std::uint64_t>(lasts.ns / 1'000'000 * 1.0005));
            begins = begins + lasts;
        }
}

TEST_CASE("tick_numbers: those of the first grid are the board's") {
    TickNumbers numbers;
    CHECK(numbers.number(0, 7) == 7);
    numbers.grid_began(HostTime{1'000'000'000});
    CHECK(numbers.number(0, 7) == 7);
    numbers.grid_began(HostTime{2'000'000'000});
    CHECK(numbers.number(0, 8) == numbers.number(0, 7) + 1);
}

TEST_CASE("tick_numbers: a camera of another rate goes on beyond its own, and others as they do") {
    TickNumbers numbers;
    numbers.grid_began(HostTime{0});
    std::uint64_t newest = numbers.number(1, 20'000);  // 1 kHz for 20 s
    for (const std::int64_t seconds_since : {20, 40, 60}) {
        numbers.rate_changed(0b1010, HostTime{} + seconds(seconds_since));
        const auto slow = static_cast<std::uint64_t>(seconds_since) / 2;  // 0.5 Hz on that grid
        CHECK(numbers.number(1, slow) > newest);
        CHECK(numbers.number(3, slow) == numbers.number(1, slow));
        CHECK(numbers.number(0, 20'001) == 20'001);
        newest = numbers.number(1, static_cast<std::uint64_t>(seconds_since + 20) * 1'000);
    }
    numbers.grid_began(HostTime{80'000'000'000});
    CHECK(numbers.number(1, 0) > newest);
    CHECK(numbers.number(0, 5) == numbers.number(1, 5));
}
