// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("030-host-restarts: a new hello stops the cameras, numbers go on, samples never stop") {
    Scenario world;
    world.add_camera(0);
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 204.8, true);
    world.gaps_allowed = true;
    for (int life = 0; life < 20; ++life) {
        REQUIRE(world.begin(wire::start_pattern));
        world.run(1700 * ms);
        CHECK((world.inbox().exposures[0].back().flags & wire::exposure_measured) != 0);
    }
    world.finish();
    CHECK(world.inbox().hellos.size() == 20);
    CHECK(world.inbox().hellos.front().board_time_ns < world.inbox().hellos.back().board_time_ns);
    // The part is set up once: sending the same settings again does not disturb it.
    CHECK(world.inbox().events_of(wire::BoardEventKind::imu_ready).size() == 1);
    CHECK(world.judge() == "");
}

TEST_CASE("030-silent-until-hello: nothing is sent to what may be an echoing terminal") {
    Scenario world;
    world.add_camera(0);
    world.run(10 * second);
    CHECK(world.inbox().packets == 0);
    const std::uint8_t echo[] = {'h', 'e', 'l', 'l', 'o', 0, 0x01, 0x02, 0};
    world.send_bytes(echo);
    world.run(second);
    CHECK(world.inbox().packets == 0);
    REQUIRE(world.begin());
}

TEST_CASE(
    "030-another-life: a host that asks for the time learns of the new life, an echo nothing") {
    Scenario world;
    world.send(wire::ClockRequest{1, 0});
    world.run(second);
    REQUIRE(world.inbox().hellos.size() == 1);
    wire::Frame echo{};
    wire::encode(world.inbox().hellos.front(), 1, 0, echo);
    world.send_bytes({echo.bytes, echo.size});
    world.send(wire::Start{1, 0, {}});
    world.run(second);
    CHECK(world.inbox().packets == 1);
    REQUIRE(world.begin());
}

TEST_CASE(
    "030-reconfigured-in-flight: a configuration waits for the pulse that is on its way, none is "
    "cut") {
    Scenario world;
    world.add_camera(0, {}, 100'000'000);
    world.configuration.cameras[0].pulse_ns = 2'000'000;
    world.gaps_allowed = true;
    world.connect();
    REQUIRE(world.configure());
    std::vector<Nanoseconds> widths;
    for (int i = 0; i < 200; ++i) {
        world.start();
        world.run(40 * ms + i * 61 * us);
        world.stop();
        REQUIRE(world.configure());
    }
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().exposures[0].size() == world.rises(0).size());
}
