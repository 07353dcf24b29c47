// SPDX-License-Identifier: BSD-3-Clause
#include "camera/device_claims.hpp"

#include <catch2/catch.hpp>

using namespace versavis::daemon;

TEST_CASE("device_claims: a device is one camera, until that has another") {
    DeviceClaims claims;
    CHECK(claims.claim("left", "10.0.0.2").empty());
    CHECK(claims.claim("left", "10.0.0.2").empty());
    CHECK(claims.claim("right", "10.0.0.2") == "left");
    CHECK(claims.claim("left", "10.0.0.3").empty());
    CHECK(claims.claim("right", "10.0.0.2").empty());
}
