// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "004-strobe-lost: a trigger without edges, with one, or none at all, is reported as what it is",
    "[native]") {
    const auto seed = GENERATE(range(1U, 9U));
    Scenario world(seed);
    CameraSettings settings;
    settings.fault = [seed](std::uint64_t pulse) {
        const std::uint64_t draw = (pulse * 2654435761U + seed * 97) % 16;
        if (draw == 0) return Fault::no_strobe;
        if (draw == 1) return Fault::start_lost;
        if (draw == 2) return Fault::end_lost;
        return draw == 3 ? Fault::ignored : Fault::none;
    };
    world.add_camera(0, settings);
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& records = world.inbox().exposures[0];
    CHECK(count(records, wire::exposure_measured) > 500);
    CHECK(count(records, wire::exposure_no_start) > 50);
    CHECK(count(records, wire::exposure_no_end) > 20);
}
