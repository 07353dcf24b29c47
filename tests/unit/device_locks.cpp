// SPDX-License-Identifier: BSD-3-Clause
#include "camera/device_locks.hpp"

#include <catch2/catch.hpp>

using namespace versavis::daemon;

TEST_CASE("device_locks: a device is one camera, until that has another") {
    DeviceLocks claims;
    CHECK(claims.claim("left", "10.0.0.2").empty());
    CHECK(claims.claim("left", "10.0.0.2").empty());
    CHECK(claims.claim("right", "10.0.0.2") == "left");
    CHECK(claims.claim("left", "10.0.0.3").empty());
    CHECK(claims.claim("right", "10.0.0.2").empty());
}
