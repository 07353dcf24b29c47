// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_counters.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

wire::Health counter_report(std::uint32_t lost_edges, std::uint32_t imu_errors) {
    wire::Health health{};
    health.glitches = lost_edges * 2;
    health.lost_edges = lost_edges;
    health.imu_errors[1] = imu_errors;
    health.loop_max_ns = 77;
    return health;
}

}  // namespace

TEST_CASE("board_counters: what was counted before the service looked is taken off") {
    BoardCounters counters;
    counters.board_restarted();  // the life of the first hello may be old
    CHECK(counters.since_start(counter_report(1000, 5)).lost_edges == 0);
    const wire::Health later = counters.since_start(counter_report(1003, 7));
    CHECK(later.lost_edges == 3);
    CHECK(later.glitches == 6);
    CHECK(later.imu_errors[1] == 2);
    CHECK(later.loop_max_ns == 77);
}

TEST_CASE("board_counters: a new life adds to the one before") {
    BoardCounters counters;
    counters.since_start(counter_report(1000, 0));
    counters.since_start(counter_report(1004, 0));
    counters.board_restarted();
    CHECK(counters.since_start(counter_report(2, 0)).lost_edges == 6);
    const wire::Health sum = counters.since_start(counter_report(3, 0));
    CHECK(sum.lost_edges == 7);
    CHECK(sum.glitches == 14);
}

TEST_CASE("board_counters: a counter that goes back says nothing") {
    BoardCounters counters;
    counters.since_start(counter_report(10, 0));
    CHECK(counters.since_start(counter_report(4, 0)).lost_edges == 0);
    CHECK(counters.since_start(counter_report(4, 0)).glitches == 0);
    CHECK(counters.since_start(counter_report(5, 0)).lost_edges == 1);
}
