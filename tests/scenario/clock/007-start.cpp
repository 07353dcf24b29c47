// SPDX-License-Identifier: BSD-3-Clause
// How soon the first stamps are good.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 007: a millisecond at the first exchange, a tenth soon after") {
    std::vector<double> seconds_to_tenth;
    int worse_than_a_millisecond = 0;  // of some 60'000: first exchanges that were late by more
    Settings settings;
    settings.length = seconds(20);
    for (settings.seed = 1; settings.seed <= 300; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        const TrueTime first = world.deliveries().front().at;
        TrueTime worse = first;
        for (const Delivery& delivery : world.deliveries()) {
            const Duration error = absolute(observer.error(delivery.at));
            worse_than_a_millisecond += error >= milliseconds(1) ? 1 : 0;
            if (error >= microseconds(100)) worse = delivery.at;
        }
        seconds_to_tenth.push_back(static_cast<double>((worse - first).ns) * 1e-9);
    }
    CHECK(worse_than_a_millisecond <= 15);
    std::sort(seconds_to_tenth.begin(), seconds_to_tenth.end());
    CHECK(seconds_to_tenth[150] <= 1);
    CHECK(seconds_to_tenth[285] <= 2);
}
