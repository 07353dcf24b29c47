// SPDX-License-Identifier: BSD-3-Clause
// The same with the packets of an IMU, which are stamped as well.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 004: exchanges and IMU packets over USB") {
    Settings settings;
    settings.imu_hz = 200;
    Score result = score<clock::EnvelopeFilter>(settings, 8);
    CHECK(result.p99_us() <= 9);
    check_honest(result);
}
