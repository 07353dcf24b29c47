// SPDX-License-Identifier: BSD-3-Clause
// Many seeds, mixed troubles: whatever happened, minutes later all is well.
#include <catch2/catch.hpp>

#include "score.hpp"
#include "troubles.hpp"
#include "versavis/clock/envelope_filter.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 017: no seed locks the filter out") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
        const Settings settings = troubled(seed);
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        CAPTURE(seed);
        CHECK(instants_off(world, observer) == 0);
    }
}
