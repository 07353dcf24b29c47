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
            CHECK((newest == 0 || numbers.number(0) > newest));
            newest = numbers.number(static_cast<std::uint64_t>(lasts.ns / 1'000'000 * 1.0005));
            begins = begins + lasts;
        }
}

TEST_CASE("tick_numbers: those of the first grid are the board's") {
    TickNumbers numbers;
    CHECK(numbers.number(7) == 7);
    numbers.grid_began(HostTime{1'000'000'000});
    CHECK(numbers.number(7) == 7);
    numbers.grid_began(HostTime{2'000'000'000});
    CHECK(numbers.number(8) == numbers.number(7) + 1);
}
