// SPDX-License-Identifier: BSD-3-Clause
#include "camera/retry.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("retry: what somebody has to mend is tried later and later, up to ten seconds") {
    Retry retry;
    Duration last;
    for (const int ms : {500, 1000, 2000, 4000, 8000, 10000, 10000}) {
        last = retry.after(CameraState::misconfigured);
        CHECK(last == milliseconds(ms));
    }
    retry.restart();
    CHECK(retry.after(CameraState::failed) == milliseconds(500));
}

TEST_CASE("retry: what may end by itself is tried soon") {
    Retry retry;
    for (int i = 0; i < 3; ++i) {
        CHECK(retry.after(CameraState::absent) == Retry::soon);
        CHECK(retry.after(CameraState::busy) == Retry::soon);
        CHECK(retry.after(CameraState::silent) == Duration{});
        CHECK(retry.after(CameraState::opening) == Duration{});
    }
}
