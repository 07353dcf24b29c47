// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("012-every-rate: each whole rate from 1 to 200 Hz runs, and is met") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 1 * ms; };
    world.add_camera(0, settings);
    world.gaps_allowed = true;
    world.connect();
    for (std::uint32_t hertz = 1; hertz <= 200; ++hertz) {
        world.configuration.cameras[0].rate_uhz = hertz * 1'000'000;
        REQUIRE(world.configure());
        const std::size_t before = world.camera(0).pulses().size();
        world.inbox().exposures.clear();
        world.start();
        world.run(4 * second);
        world.stop();
        world.run(200 * ms);
        const auto sent = static_cast<double>(world.camera(0).pulses().size() - before);
        INFO(hertz << " Hz");
        REQUIRE(sent == Approx(4.0 * hertz).margin(1.1));
        for (const wire::Exposure& record : world.inbox().exposures[0])
            if (record.trigger > before + 1) REQUIRE(world.grid_error(record) == 0);
    }
}
