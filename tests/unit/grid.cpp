// SPDX-License-Identifier: BSD-3-Clause
#include "grid.hpp"

#include <catch2/catch.hpp>

using versavis::firmware::Grid;

TEST_CASE("grid: no rate drifts, whole or not") {
    const std::uint32_t rate_uhz =
        GENERATE(100'000U, 7'000'000U, 14'000'000U, 29'970'000U, 90'000'000U, 1'000'000'000U);
    Grid grid(1'000, rate_uhz);
    constexpr std::uint64_t ticks = 1'000'000;
    for (std::uint64_t i = 0; i < ticks; ++i) {
        if (i % 1000 == 0) {
            const auto exact = static_cast<__int128>(i) * 1'000'000'000'000'000 / rate_uhz;
            REQUIRE(grid.next() == 1'000 + static_cast<std::int64_t>(exact));
        }
        grid.advance();
    }
    CHECK(grid.tick() == ticks);
}
