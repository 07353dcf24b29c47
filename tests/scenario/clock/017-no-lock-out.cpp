// SPDX-License-Identifier: BSD-3-Clause
// Many seeds, mixed troubles: whatever happened, minutes later all is well.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"
#include "troubles.hpp"

using namespace versavis;
using namespace versavis::clock_world;

namespace {

void check_recovery(std::uint64_t seed) {
    const Settings settings = troubled(seed);
    const World world(settings);
    Observer<clock::EnvelopeFilter> observer(world);
    CAPTURE(seed);
    CHECK(instants_off(world, observer) == 0);
}

}  // namespace

TEST_CASE("clock 017: no seed locks the filter out") {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) check_recovery(seed);
}

TEST_CASE("clock 017: after slews both edges do not slide below what they bound") {
    for (const std::uint64_t seed : {845, 949, 1773, 3269, 3835, 5355}) check_recovery(seed);
}
