// SPDX-License-Identifier: BSD-3-Clause
// What all clients for ROS share: names, states, and the graph of clocks.
#include <catch2/catch.hpp>

#include "ros_client/diagnostics.hpp"
#include "ros_client/names.hpp"
#include "ros_client/sync_graph.hpp"

using namespace versavis;
using namespace versavis::ros_client;

TEST_CASE("ros_client: pixel formats have the names that ROS has") {
    CHECK(encoding_of(0x01080001) == "mono8");
    CHECK(encoding_of(0x01100005) == "mono16");
    CHECK(encoding_of(0x01100007) == "mono16");
    CHECK(encoding_of(0x01080008) == "bayer_grbg8");
    CHECK(encoding_of(0x01080009) == "bayer_rggb8");
    CHECK(encoding_of(0x0108000A) == "bayer_gbrg8");
    CHECK(encoding_of(0x0108000B) == "bayer_bggr8");
    CHECK(encoding_of(0x02180014) == "rgb8");
    CHECK(encoding_of(0x02180015) == "bgr8");
    CHECK(encoding_of(0x010C0047) == "Mono12p");
    CHECK(encoding_of(7) == "unknown");
}

TEST_CASE("ros_client: topics are names that ROS accepts") {
    CHECK(topic_part("cam0-evidence") == "cam0_evidence");
    CHECK(topic_part("0.left") == "_0_left");
}

TEST_CASE("ros_client: clocks of the graph are what protobuf's own encoder makes of them") {
    // By `protoc --encode` of messages with these fields.
    const std::string locked(
        "\x0a\x01s\x5a\x0c\x0a\x08\x0a\x06\x0a\x04"
        "cam0"
        "\x10\x03",
        17);
    CHECK(clock_state_update("s", "cam0", ClockState::locked) == locked);
    const std::string behind(
        "\x0a\x01s\x1a\x1a\x0a\x05\x2a\x03\x0a\x01h\x12\x06\x0a\x04\x0a\x02"
        "i0"
        "\x18\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
        31);
    CHECK(clock_difference_update("s", "h", "i0", Duration{-1}) == behind);
}

TEST_CASE("ros_client: only devices whose stamps are proved have a difference") {
    const auto status = nlohmann::json::parse(R"({"instance": "car",
        "clock": {"health": "ok", "output_minus_host_ns": 700},
        "cameras": [{"name": "a", "trigger": "board", "health": "ok", "pairing": "locked"},
                    {"name": "b", "trigger": "board", "health": "ok", "pairing": "checking"},
                    {"name": "c", "trigger": "free", "health": "ok", "pairing": "none"}],
        "imus": [{"name": "i", "health": "degraded"}]})");
    const ClockReading now{HostTime{1000}, 1600};
    CHECK(graph_updates("h", status, now) ==
          std::vector{clock_state_update("versavis/car", "a", ClockState::locked),
                      clock_difference_update("versavis/car", "h", "a", Duration{100}),
                      clock_state_update("versavis/car", "b", ClockState::tracking),
                      clock_state_update("versavis/car", "i", ClockState::lost)});
    auto unknown = status;
    unknown["clock"]["output_minus_host_ns"] = "soon";
    CHECK(graph_updates("h", unknown, now).size() == 3);
    CHECK(graph_updates("h", nlohmann::json::object(), now).empty());
}

TEST_CASE("ros_client: a status is a list of devices, and silence is one, too") {
    const auto status = nlohmann::json::parse(R"({
        "board": {"state": "unused"}, "clock": {"state": "synchronised", "health": "ok"},
        "cameras": [{"name": "a", "trigger": "board", "health": "degraded", "state": "absent",
                     "fault": "gone", "hint": "plug it in", "serial": "7", "setup": [1],
                     "exposures_unmeasured": 3}],
        "imus": [{"name": "i", "health": "ok", "hint": "hot"}],
        "time_outputs": [{"name": "t", "health": "degraded", "state": "waiting",
                          "fault": "time_unknown"}]})");
    const auto all = diagnostics("car", status, "");
    REQUIRE(all.size() == 4);
    CHECK(all[3].name == "car: t");
    CHECK(all[3].message == "waiting, time_unknown");
    CHECK(all[0].name == "car: clock");
    CHECK(all[0].level == Level::ok);
    CHECK(all[1].level == Level::error);
    CHECK(all[1].message == "absent, gone: plug it in");
    CHECK(all[1].hardware_id == "7");
    CHECK(all[1].values.back().text == "middle of the exposure");
    CHECK(all[2].level == Level::warn);
    const auto silent = diagnostics("car", {}, "dead");
    REQUIRE(silent.size() == 1);
    CHECK(silent[0].level == Level::stale);
    CHECK(silent[0].message == "dead");
}
