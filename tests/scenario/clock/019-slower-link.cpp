// SPDX-License-Identifier: BSD-3-Clause
// The link gets slower, both ways alike: another power state, a hub in between.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 019: longer delays of both directions move no clock, nor do shorter ones again") {
    UsbSettings usb;
    usb.slow = {{seconds(100).ns}, {seconds(300).ns}};
    usb.slower = GENERATE(microseconds(200), milliseconds(1), milliseconds(5));
    Settings settings;
    settings.length = seconds(400);
    settings.imu_hz = GENERATE(0.0, 200.0);
    settings.link = [usb](Random& random) { return usb_full_speed(usb, random); };
    Score result = score<clock::EnvelopeFilter>(settings, 8, {seconds(100).ns});
    CHECK(result.p99_us() < 100);
    CHECK(result.quantile_us(0.5) < 20);
    CHECK(result.beyond_bound() < 0.01);
}
