// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/arrival_check.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("arrival_check: nothing comes from the future, and nothing from long ago") {
    test::Pipelines bench;
    const HostTime now{90'000'000'000};
    const auto check = [&](Duration age) {
        const auto implausible =
            contradicts_arrival(test::Pipelines::to_board(now - age), now, bench.translator);
        return implausible ? implausible->reason : EventReason::none;
    };
    CHECK(check(-seconds(1000)) == EventReason::none);  // the clock is unknown
    bench.synchronise(now);
    CHECK(check(-seconds(1000)) == EventReason::not_yet);
    // The estimate could be off by any time over a hundred days, but this arrived now.
    CHECK(check(-seconds(9'007'199)) == EventReason::not_yet);
    CHECK(check(seconds(9'007'199)) == EventReason::too_old);
    CHECK(check(-milliseconds(2)) == EventReason::not_yet);
    CHECK(check(Duration{}) == EventReason::none);
    CHECK(check(seconds(9)) == EventReason::none);
    CHECK(check(seconds(11)) == EventReason::too_old);
}
