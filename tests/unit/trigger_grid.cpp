// SPDX-License-Identifier: BSD-3-Clause
#include "board/trigger_grid.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("trigger_grid: triggers lie on the board's grid, less their latency, without drift") {
    TriggerGrid grid;
    CHECK_FALSE(grid.trigger(0, 1));
    wire::ConfigurationAnswer answer{};
    answer.origin_ns = 5'000'000'000;
    answer.taken.cameras[1].rate_uhz = 30'000'000;
    answer.taken.cameras[1].phase_ns = 70'000;
    answer.taken.cameras[1].latency_ns = 20'000;
    grid.configured(answer);
    CHECK(grid.trigger(1, 0) == BoardTime{5'000'050'000});
    CHECK(grid.trigger(1, 1) == BoardTime{5'033'383'333});
    // 30 Hz after a day: no rounding has added up.
    CHECK(grid.trigger(1, 30ULL * 86'400) == BoardTime{86'405'000'050'000});
    CHECK_FALSE(grid.trigger(0, 1));  // it is not used
    CHECK_FALSE(grid.trigger(wire::camera_count, 1));
    for (const std::uint64_t tick : {std::uint64_t{1} << 38U, std::uint64_t{276'701'161'105},
                                     std::uint64_t{1} << 40U, UINT64_MAX})
        CHECK_FALSE(grid.trigger(1, tick));
    for (const std::int64_t origin : {INT64_MIN, std::int64_t{-1} << 60U, INT64_MAX}) {
        answer.origin_ns = origin;
        grid.configured(answer);
        CHECK_FALSE(grid.trigger(1, 7));
    }
    grid.forget();
    CHECK_FALSE(grid.trigger(1, 0));
}
