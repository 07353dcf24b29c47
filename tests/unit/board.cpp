// SPDX-License-Identifier: BSD-3-Clause
// The board's words to the host; what it does is told by the scenarios.
#include "board.hpp"

#include <catch2/catch.hpp>

#include "adis_device.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("board: it says who it is, and what it can do") {
    World world;
    world.connect();
    REQUIRE(world.inbox().hellos.size() == 1);
    const wire::BoardHello& hello = world.inbox().hellos[0];
    CHECK(hello.major == wire::protocol_major);
    CHECK(hello.cameras == 4);
    CHECK(std::string(hello.serial) == "TEST");
    CHECK((hello.capabilities & wire::capability_slaves) != 0);
    CHECK(hello.reset_cause == wire::ResetCause::power_on);
}

TEST_CASE("board: a host of another major version is told who is there, and nothing more") {
    World world;
    world.send(wire::HostHello{wire::protocol_major + 1, 0, {}});
    world.run(100 * ms);
    REQUIRE(world.inbox().hellos.size() == 1);
    world.send(wire::ClockRequest{1, 0});
    world.run(3 * second);
    CHECK(world.inbox().packets == 1);
}

TEST_CASE(
    "board: a clock request is answered with the instants at which it came and at which the answer left") {
    World world;
    world.connect();
    world.run(second);
    world.send(wire::ClockRequest{77, 0});
    const Nanoseconds asked = world.now();
    world.run(10 * ms);
    REQUIRE(world.inbox().clock_answers.size() == 1);
    CHECK(world.inbox().clock_answers[0].id == 77);
    CHECK(world.inbox().clock_answers[0].received_ns == asked);
    CHECK(world.inbox().clock_answers[0].sent_ns >= asked);
}

TEST_CASE("board: its health comes once a second") {
    World world;
    world.connect();
    world.run(10 * second);
    CHECK(world.inbox().healths.size() == 10);
    CHECK(world.inbox().lost == 0);
}

TEST_CASE("board: when a clock answer left is told after it, also when the host was slow to take it") {
    World world;
    world.connect();
    for (const Nanoseconds stall : {Nanoseconds{0}, 300 * ms}) {
        world.inbox() = {};
        world.stall_host(stall);
        world.send(wire::ClockRequest{77, 0});
        const Nanoseconds asked = world.now();
        world.run(stall + 10 * ms);
        REQUIRE(world.inbox().clock_answers.size() == 1);
        REQUIRE(world.inbox().follow_ups.size() == 1);
        const wire::ClockFollowUp& told = world.inbox().follow_ups[0];
        CHECK(told.id == 77);
        CHECK(world.inbox().clock_answers[0].sent_ns - asked < ms);
        CHECK(told.sent_ns >= asked + stall);
        CHECK(told.sent_ns <= asked + stall + ms);
    }
}

TEST_CASE("board: each sample says how old it was when it left") {
    World world;
    world.add_imu(std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
                  wire::ImuKind::adis16448b, 204.8, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    REQUIRE(world.inbox().samples[0].size() > 200);
    for (const wire::ImuSample& sample : world.inbox().samples[0]) {
        REQUIRE(sample.departure_ns > 0);
        REQUIRE(sample.departure_ns < 2'000'000);  // read at once, and the link is free
    }
}
