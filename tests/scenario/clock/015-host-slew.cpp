// SPDX-License-Identifier: BSD-3-Clause
// The clock of the host is slewed by 500 ppm for 20 s.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 015: a slew that a raw clock never makes is followed within seconds") {
    Settings settings;
    settings.length = seconds(300);
    settings.host_changes = {{{seconds(100).ns}, {}, 500}, {{seconds(120).ns}, {}, 0}};
    for (settings.seed = 1; settings.seed <= 10; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        Score slewing;
        observer.observe({{seconds(100).ns}, {seconds(119).ns}}, milliseconds(100), slewing);
        CHECK(slewing.largest_us() < 2'000);
        CHECK(absolute(observer.error({seconds(119).ns})) < microseconds(300));
        CHECK(absolute(observer.error({seconds(180).ns})) < microseconds(40));
    }
}
