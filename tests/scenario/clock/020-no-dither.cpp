// SPDX-License-Identifier: BSD-3-Clause
// Requests that beat with the frames of the bus: shortest delays come and go, and surprise for
// ever.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 020: any number of surprises leaves an estimate with a sane sigma") {
    Settings settings;
    settings.dither = GENERATE(0.0, 0.0005, 0.002);
    for (settings.seed = 1; settings.seed <= 12; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        for (TrueTime t{seconds(5).ns}; t.ns < settings.length.ns; t = t + seconds(1)) {
            const clock::HostEstimate estimate = observer.estimate(t);
            REQUIRE(estimate.sigma > Duration{});
            REQUIRE(estimate.sigma < milliseconds(20));
            REQUIRE(absolute(estimate.time - world.host(t)) < milliseconds(5));
        }
    }
}
