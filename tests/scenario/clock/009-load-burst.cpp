// SPDX-License-Identifier: BSD-3-Clause
// For 30 s the scheduler delays each wake-up by 6 ms in the mean.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

namespace {

Settings loaded(double imu_hz) {
    Settings settings;
    settings.imu_hz = imu_hz;
    settings.length = seconds(440);
    settings.link = [](Random& random) {
        return usb_full_speed({.load = {{seconds(400).ns}, {seconds(430).ns}}}, random);
    };
    return settings;
}

}  // namespace

TEST_CASE("clock 009: a burst of load") {
    const Settings settings = loaded(GENERATE(0.0, 200.0));
    Score result = score<clock::EnvelopeFilter>(settings, 20, {seconds(400).ns});
    CHECK(result.largest_us() <= (settings.imu_hz > 0 ? 25 : 20));
    check_honest(result);
}

TEST_CASE("clock 009: several surprises at its end widen the skew by no more than they say") {
    Settings settings = loaded(200);
    settings.seed = 26;
    const World world(settings);
    Observer<clock::EnvelopeFilter> observer(world);
    for (TrueTime t{seconds(400).ns}; t.ns < settings.length.ns; t = t + milliseconds(100))
        REQUIRE(observer.estimate(t).sigma < microseconds(50));
}
