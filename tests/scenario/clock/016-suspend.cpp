// SPDX-License-Identifier: BSD-3-Clause
// The host sleeps for a minute; its raw clock stands still meanwhile.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 016: a suspended host is back after three exchanges") {
    Settings settings;
    settings.length = seconds(260);
    settings.silence = {{seconds(100).ns}, {seconds(160).ns}};
    settings.host_changes = {{{seconds(160).ns}, -seconds(60)}};
    for (settings.seed = 1; settings.seed <= 10; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        const TrueTime awake{seconds(160).ns};
        CHECK(absolute(observer.error(awake + milliseconds(600))) < milliseconds(1));
        CHECK(absolute(observer.error(awake + seconds(90))) < microseconds(40));
        CHECK(observer.at(awake + seconds(90)).restarts() == 1);
    }
}
