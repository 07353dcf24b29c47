// SPDX-License-Identifier: BSD-3-Clause
// No contact for a minute.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 008: sigma grows as the error does without contact") {
    Settings settings;
    settings.length = seconds(470);
    settings.silence = {{seconds(400).ns}, {seconds(480).ns}};
    Score after_10_s;
    Score after_60_s;
    for (settings.seed = 1; settings.seed <= 60; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        for (const auto& [silent, result] :
             {std::pair{seconds(10), &after_10_s}, {seconds(60), &after_60_s}}) {
            const TrueTime now = settings.silence.begin + silent;
            const clock::HostEstimate estimate = observer.estimate(now);
            CHECK(estimate.state == clock::ClockState::holdover);
            result->add(estimate.time - world.host(now), estimate);
        }
    }
    CHECK(after_10_s.quantile_us(0.95) <= 16);
    CHECK(after_60_s.quantile_us(0.95) <= 33);
    CHECK(after_60_s.nees() < 2);
    CHECK(after_60_s.nees() > 0.3);
}
