// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("028-unconnected: edges at an input that nothing is configured for cost nothing") {
    Scenario world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.add_noise(2, 3 * us, second, 2 * second);
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().events_of(wire::BoardEventKind::input_noisy).empty());
    CHECK(world.inbox().healths.back().lost_edges == 0);
}

TEST_CASE(
    "028-noisy-input: an input that changes without end is not listened to for a while, all else "
    "goes on") {
    Scenario world;
    for (unsigned camera = 0; camera < 3; ++camera) world.add_camera(camera);
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 819.2, true);
    world.configuration.ports.inputs = 1U << wire::pulse_aux0;
    REQUIRE(world.begin());
    world.add_noise(firmware::input_pulse + unsigned{wire::pulse_aux0}, 10 * us, 2 * second,
                    4500 * ms);
    world.run(10 * second);
    world.finish();
    const auto noisy = world.inbox().events_of(wire::BoardEventKind::input_noisy);
    REQUIRE(noisy.size() == 3);  // once a second while it lasts
    CHECK(noisy[0].source == firmware::input_pulse + unsigned{wire::pulse_aux0});
    CHECK(world.inbox().healths.back().noisy_inputs == 3);
    CHECK(world.judge() == "");
}

TEST_CASE(
    "028-noisy-strobe: a strobe line that floats spoils its own camera's records only, and none is "
    "invented") {
    Scenario world;
    for (unsigned camera = 0; camera < 3; ++camera) world.add_camera(camera);
    REQUIRE(world.begin());
    world.run(second);
    CameraSettings& noisy = world.camera(1).settings();
    noisy.strobe = false;
    world.add_noise(1, 7 * us, world.now(), world.now() + second);
    const Nanoseconds from = world.now();
    world.run(3 * second);
    world.finish();
    for (const unsigned camera : {0U, 2U})
        for (const wire::Exposure& record : world.inbox().exposures[camera])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    CHECK(world.inbox().healths.back().stray_edges > 100);
    // Reported ten times a second; all are counted.
    CHECK(world.inbox().events_of(wire::BoardEventKind::stray_edge).size() <= 30);
    CHECK(world.inbox().events_of(wire::BoardEventKind::input_noisy).size() == 1);
    for (const wire::Exposure& record : world.inbox().exposures[1])
        if (record.trigger_ns > from + 1100 * ms)
            REQUIRE((record.flags & wire::exposure_no_start) != 0);
}
