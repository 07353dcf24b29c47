// SPDX-License-Identifier: BSD-3-Clause
// Half of the messages never arrive.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 011: lost messages") {
    Settings settings;
    settings.lost = 0.5;
    settings.imu_hz = 200;
    Score result = score<clock::EnvelopeFilter>(settings, 6);
    CHECK(result.p99_us() <= 16);
    CHECK(result.nees() < 2);
}
