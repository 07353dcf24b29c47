// SPDX-License-Identifier: BSD-3-Clause
#include "base/grid.hpp"

#include <catch2/catch.hpp>

using versavis::firmware::Grid;
using versavis::firmware::Nanoseconds;

namespace {

/// Of whole ticks, computed with 128 bits.
Nanoseconds exact_time(std::uint64_t ticks, std::uint32_t rate_uhz) {
    return static_cast<Nanoseconds>(static_cast<__int128>(ticks) * 1'000'000'000'000'000 /
                                    rate_uhz);
}

}  // namespace

TEST_CASE("grid: no rate drifts, whole or not") {
    const std::uint32_t rate_uhz = GENERATE(100'000U, 100'001U, 7'000'000U, 14'000'000U,
                                            29'970'000U, 90'000'000U, 1'000'000'000U);
    Grid grid(1'000, rate_uhz);
    CHECK(grid.period() == exact_time(1, rate_uhz));
    constexpr std::uint64_t ticks = 100'000;
    for (std::uint64_t i = 0; i < ticks; ++i) {
        if (i < 1000 || i % 1000 == 0) REQUIRE(grid.next() == 1'000 + exact_time(i, rate_uhz));
        grid.advance();
    }
    CHECK(grid.tick() == ticks);
}

TEST_CASE("grid: many ticks at once are as many single ones") {
    // The fastest is that of an IMU; its remainder is the largest of all. The slowest ends within
    // the 292 years of time.
    const std::uint32_t rate_uhz = GENERATE(29'970'000U, 390'000U, 4'294'967'295U);
    Grid grid(7, rate_uhz);
    std::uint64_t tick = 0;
    for (const std::int64_t ticks :
         {0LL, 1LL, 2LL, 1000LL, 399'999'999LL, 400'000'000LL, 400'000'001LL, 2'000'000'000LL}) {
        grid.advance_by(ticks);
        tick += static_cast<std::uint64_t>(ticks);
        REQUIRE(grid.tick() == tick);
        REQUIRE(grid.next() == 7 + exact_time(tick, rate_uhz));
        grid.advance();
        ++tick;
        REQUIRE(grid.next() == 7 + exact_time(tick, rate_uhz));
    }
}

TEST_CASE("grid: it skips to a tick within a period before an instant, and never behind it") {
    const std::uint32_t rate_uhz = GENERATE(29'970'000U, 300'000U, 1'000'000'000U, 4'294'967'295U);
    for (const Nanoseconds at :
         {0LL, 5'000LL, 100'000'000LL, 1'234'567'890'123LL, 31'536'000'000'000'000LL}) {
        Grid grid(5'000, rate_uhz);
        grid.skip_before(at);
        CHECK(grid.next() == 5'000 + exact_time(grid.tick(), rate_uhz));
        CHECK(grid.next() <= (at < 5'000 ? 5'000 : at));
        CHECK(at - grid.next() <= grid.period());
    }
    Grid grid(0, rate_uhz);
    grid.skip_before(grid.period());
    CHECK(grid.tick() == 0);
    grid.skip_before(grid.period() + 1);
    CHECK(grid.tick() == 1);
}

TEST_CASE("grid: one that was never set stays where it is") {
    Grid grid;
    CHECK(grid.next() == 0);
    CHECK(grid.tick() == 0);
    CHECK(grid.period() == 0);
    grid.advance();
    grid.advance_by(1'000);
    CHECK(grid.next() == 0);
    CHECK(grid.tick() == 1'001);
}
