// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "016-slow-start: one pulse a second until the host says that it knows, and nothing is stuck "
    "there") {
    Scenario world;
    world.add_camera(0, {}, 29'970'000);
    world.gaps_allowed = true;
    REQUIRE(world.begin(wire::start_slow));
    world.run(10 * second);
    const auto& pulses = world.camera(0).pulses();
    CHECK(pulses.size() >= 9);
    CHECK(pulses.size() <= 11);
    for (std::size_t i = 1; i < pulses.size(); ++i)
        CHECK(pulses[i].at - pulses[i - 1].at >= second - 5 * ms);
    CHECK(count(world.inbox().exposures[0], wire::exposure_slow) ==
          world.inbox().exposures[0].size());
    // The word that ends it is damaged on its way: it is counted, and the host's next one works.
    const std::size_t before = pulses.size();
    const std::uint8_t damaged[] = {0x02, 0x83, 0x11, 0x22, 0x00};
    world.send_bytes(damaged);
    world.run(2 * second);
    CHECK(pulses.size() <= before + 3);
    CHECK(world.inbox().healths.back().receive_errors == 1);
    world.start(1);
    world.run(2 * second);
    CHECK(pulses.size() > before + 50);
    world.finish();
    CHECK(world.judge() == "");
}
