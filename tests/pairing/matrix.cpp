// SPDX-License-Identifier: BSD-3-Clause
// The fault matrix against the goals: `campaign` runs the same with more of everything.
#include <catch2/catch.hpp>

#include "campaign.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

constexpr double needless_goal = 1e-3;

double needless(const Totals& totals) {
    return static_cast<double>(totals.withheld_needlessly) / static_cast<double>(totals.frames);
}

}  // namespace

TEST_CASE("matrix: every fault with every camera clock, width of ids and rate") {
    Totals with_clock;
    for (const Row& row : run_matrix(4)) {
        INFO(to_string(row.kind) << ", clock " << to_string(row.clock));
        const Totals& totals = row.totals;
        CHECK(totals.wrong == 0);
        if (row.kind == FaultKind::cameras_swapped) {
            CHECK(totals.published == 0);
            continue;
        }
        CHECK(totals.published > totals.frames / 4);
        if (row.clock == WorldClock::absent) {
            CHECK(quantile(totals.first_published, 1) < seconds(4));
            continue;
        }
        CHECK(totals.not_locked == 0);
        CHECK(quantile(totals.first_published, 1) < milliseconds(600));
        // A pattern that was under way when the board's clock was estimated anew ends first.
        const bool stepped =
            row.kind == FaultKind::board_time_step || row.kind == FaultKind::board_time_step_grid;
        CHECK(quantile(totals.recoveries, 0.95) < milliseconds(stepped ? 1500 : 1000));
        const bool outage =
            row.kind == FaultKind::camera_reboot || row.kind == FaultKind::board_reset;
        if (outage) CHECK_FALSE(totals.recoveries.empty());
        with_clock.frames += totals.frames;
        with_clock.withheld_needlessly += totals.withheld_needlessly;
    }
    CHECK(needless(with_clock) < needless_goal);
}

TEST_CASE("matrix: faults at random, close together at times") {
    for (const WorldClock clock : {WorldClock::good, WorldClock::drifting, WorldClock::absent}) {
        const Totals totals = run_random(clock == WorldClock::good ? 8000 : 1000, 1, clock);
        INFO("clock " << to_string(clock));
        CHECK(totals.wrong == 0);
        if (clock == WorldClock::good) CHECK(needless(totals) < needless_goal);
    }
}

TEST_CASE("matrix: worlds that once ended with wrong pairs, or without any") {
    struct Ended {
        std::uint64_t seed;
        WorldClock clock = WorldClock::good;
    };
    for (const auto& [seed, clock] : std::initializer_list<Ended>{{554},
                                                                  {929},
                                                                  {1092},
                                                                  {1184},
                                                                  {1911},
                                                                  {2147},
                                                                  {2860},
                                                                  {2953},
                                                                  {3513},
                                                                  {8552},
                                                                  {9344},
                                                                  {20099},
                                                                  {36299},
                                                                  {3520, WorldClock::absent}}) {
        const Totals totals = run_random(1, seed, clock);
        INFO("seed " << seed);
        CHECK(totals.wrong == 0);
        CHECK(totals.not_locked == 0);
    }
}
