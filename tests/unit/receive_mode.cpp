// SPDX-License-Identifier: BSD-3-Clause
#include "settings/receive_mode.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

CameraConfiguration receiving_camera(ReceiveMode receive, double rate_hz = 20) {
    CameraConfiguration camera;
    camera.receive = receive;
    camera.rate_hz = rate_hz;
    return camera;
}

/// A third of 6 ms is what arrivals may vary by, and what a packet socket makes them vary by.
constexpr double fastest_hz = 1000.0 / 6;

ReceiveMode chosen_mode(const CameraConfiguration& camera, bool allowed, bool plain = true) {
    return *choose_receive_mode(camera, allowed, plain);
}

}  // namespace

TEST_CASE("receive_mode: automatic is the packet socket where it is allowed") {
    CHECK(chosen_mode(receiving_camera(ReceiveMode::automatic), true) == ReceiveMode::packet);
    CHECK(chosen_mode(receiving_camera(ReceiveMode::automatic), false) == ReceiveMode::socket);
}

TEST_CASE("receive_mode: what is no plain image comes by the socket") {
    CHECK(chosen_mode(receiving_camera(ReceiveMode::automatic), true, false) ==
          ReceiveMode::socket);
    CHECK(chosen_mode(receiving_camera(ReceiveMode::packet), true, false) == ReceiveMode::socket);
}

TEST_CASE("receive_mode: automatic is the socket where arrivals would vary too much") {
    const auto just_slow = receiving_camera(ReceiveMode::automatic, fastest_hz - 0.01);
    const auto too_fast = receiving_camera(ReceiveMode::automatic, fastest_hz + 0.01);
    CHECK(chosen_mode(just_slow, true) == ReceiveMode::packet);
    CHECK(chosen_mode(too_fast, true) == ReceiveMode::socket);
    CHECK(receive_lateness(just_slow) == packet_socket_lateness);
    CHECK(receive_lateness(too_fast) == Duration{});
}

TEST_CASE("receive_mode: what is configured is what is used, or an error") {
    CHECK(chosen_mode(receiving_camera(ReceiveMode::socket), true) == ReceiveMode::socket);
    CHECK(receive_lateness(receiving_camera(ReceiveMode::socket)) == Duration{});
    CHECK(chosen_mode(receiving_camera(ReceiveMode::packet), true) == ReceiveMode::packet);
    CHECK(receive_lateness(receiving_camera(ReceiveMode::packet)) == packet_socket_lateness);
    const auto refused = choose_receive_mode(receiving_camera(ReceiveMode::packet), false, true);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Catch::Contains("CAP_NET_RAW"));
    CHECK_THAT(refused.error().message(), Catch::Contains("receive = \"auto\""));
}
