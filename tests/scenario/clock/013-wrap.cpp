// SPDX-License-Identifier: BSD-3-Clause
// Board time passes 2^32 ns and 2^32 us.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 013: nothing happens where 32 bits end") {
    const std::int64_t limit =
        GENERATE(std::int64_t{1} << 32, (std::int64_t{1} << 32) * 1000, (std::int64_t{1} << 53));
    Settings settings;
    settings.length = seconds(60);
    settings.board_begin = Duration{limit} - seconds(30);
    const World world(settings);
    Observer<clock::EnvelopeFilter> observer(world);
    TrueTime t{seconds(20).ns};
    for (HostTime before{}; t.ns < seconds(60).ns; t = t + milliseconds(10)) {
        const clock::HostEstimate estimate = observer.estimate(t);
        CHECK(estimate.time > before);
        CHECK(absolute(estimate.time - world.host(t)) < microseconds(60));
        before = estimate.time;
    }
    CHECK(observer.at(t).restarts() == 0);
}
