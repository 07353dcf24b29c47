// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "009-auto-exposure: the grid error is at most half the change since the exposure before") {
    const auto seed = GENERATE(range(1U, 4U));
    Scenario world(seed);
    // Brightness swings by a factor of 20 within seconds, with steps like those of a tunnel.
    CameraSettings settings;
    settings.exposure = [seed](auto, Nanoseconds at) {
        const double t = static_cast<double>(at) * 1e-9;
        const double tunnel = std::fmod(t + seed, 7.0) < 2 ? 3.0 : 1.0;
        return static_cast<Nanoseconds>(tunnel * 1e6 * (1 + 4 * (1 + std::sin(0.8 * t + seed))));
    };
    settings.readout = 2 * ms;
    world.add_camera(0, settings, 20'000'000);
    REQUIRE(world.begin());
    world.run(300 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& records = world.inbox().exposures[0];
    REQUIRE(records.size() > 5900);
    for (std::size_t i = 2; i < records.size(); ++i) {
        const Nanoseconds change = (records[i].end_ns - records[i].start_ns) -
                                   (records[i - 1].end_ns - records[i - 1].start_ns);
        REQUIRE(std::abs(world.grid_error(records[i])) <=
                std::abs(change) / 2 + 1 + 2 * world.rounding());
    }
}
