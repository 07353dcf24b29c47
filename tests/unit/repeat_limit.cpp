// SPDX-License-Identifier: BSD-3-Clause
#include "base/repeat_limit.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("repeat_limit: a line passes three times a minute, and the third says so") {
    RepeatLimit limit;
    const HostTime start{1'000'000'000};
    for (const HostTime begin : {start, start + seconds(61)}) {
        CHECK(limit.pass("silent", begin) == "silent");
        CHECK(limit.pass("streaming", begin) == "streaming");
        CHECK(limit.pass("silent", begin + seconds(1)) == "silent");
        CHECK(limit.pass("silent", begin + seconds(2)) ==
              "silent (repeats within a minute are not logged)");
        CHECK_FALSE(limit.pass("silent", begin + seconds(3)));
        CHECK_FALSE(limit.pass("silent", begin + seconds(60)));
        CHECK(limit.pass("streaming", begin + seconds(60)) == "streaming");
    }
}
