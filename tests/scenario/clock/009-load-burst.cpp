// SPDX-License-Identifier: BSD-3-Clause
// For 30 s the scheduler delays each wake-up by 6 ms in the mean.
#include <catch2/catch.hpp>

#include "honest.hpp"
#include "versavis/clock/envelope_filter.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 009: a burst of load") {
    Settings settings;
    settings.imu_hz = GENERATE(0.0, 200.0);
    settings.length = seconds(440);
    settings.link = [](Random& random) {
        return usb_full_speed({.load = {{seconds(400).ns}, {seconds(430).ns}}}, random);
    };
    Score result = score<clock::EnvelopeFilter>(settings, 20, {seconds(400).ns});
    CHECK(result.largest_us() <= (settings.imu_hz > 0 ? 25 : 20));
    check_honest(result);
}
