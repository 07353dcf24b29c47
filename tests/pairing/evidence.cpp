// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/evidence.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::pairing;

TEST_CASE("evidence: what is not said is nothing, and an exposure that nobody denies took place") {
    const Exposure exposure;
    CHECK(exposure.trigger == 0);
    CHECK(exposure.tick == 0);
    CHECK(exposure.exposed);
    CHECK(exposure.recorded.ns == 0);
    CHECK(exposure.kind == StampKind::measured_middle);
    const Arrival arrival;
    CHECK(arrival.slot == 0);
    CHECK(arrival.block_id == 0);
    CHECK(arrival.camera_time.ns == 0);
    CHECK(arrival.width == 0);
    CHECK(arrival.height == 0);
    CHECK(arrival.stride == 0);
    CHECK(arrival.pixel_format == 0);
    CHECK(arrival.size == 0);
    CHECK(Shortfall{}.block_id == 0);
}
