// SPDX-License-Identifier: BSD-3-Clause
#include "discovery/found_devices.hpp"

#include <catch2/catch.hpp>
#include <sstream>

using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

json camera(const char* serial, const char* access) {
    return {{"serial", serial},
            {"access", access},
            {"model", "BFS-PGE-19S4M-C"},
            {"address", "192.168.100.120"},
            {"preset", "allied-vision-gige"},
            {"problem", access == std::string("free") ? "" : "another program controls it"},
            {"cure", access == std::string("free") ? "" : "close that program"}};
}

json found_board() {
    return {{"serial", "E66164084373532B"},
            {"port", "usb:1-2"},
            {"state", "running"},
            {"firmware", ""},
            {"problem", ""},
            {"cure", ""}};
}

json status() {
    return {{"instance", "default"},
            {"pid", 4711},
            {"health", "ok"},
            {"board",
             {{"port", "usb:1-2"},
              {"serial", "E66164084373532B"},
              {"state", "running"},
              {"firmware", "versavis 0.2.0"},
              {"hint", ""}}},
            {"cameras", {{{"name", "cam0"}, {"serial", "22"}, {"hint", ""}}}}};
}

}  // namespace

TEST_CASE("found_devices: what a service uses is said to be in use by it, and nothing in the way") {
    const json devices = join_devices(
        json::array({found_board()}),
        {camera("22", "busy"), camera("23", "busy"), camera("24", "free")}, {status()});
    CHECK(devices["services"] == json{{{"instance", "default"}, {"pid", 4711}, {"health", "ok"}}});
    CHECK(devices["boards"][0]["used_by"]["instance"] == "default");
    CHECK(devices["boards"][0]["firmware"] == "versavis 0.2.0");
    CHECK(devices["cameras"][0]["used_by"] ==
          json{{"instance", "default"}, {"pid", 4711}, {"name", "cam0"}});
    CHECK(devices["cameras"][0]["problem"] == "");
    CHECK(devices["cameras"][1]["used_by"].is_null());
    CHECK(devices["cameras"][1]["problem"] == "another program controls it");
    CHECK(devices["cameras"][2]["used_by"].is_null());
}

TEST_CASE("found_devices: a camera of a status that it is free of is not in use") {
    const json devices =
        join_devices(json::array(), json::array({camera("22", "free")}), {status()});
    CHECK(devices["cameras"][0]["used_by"].is_null());
}

TEST_CASE("found_devices: a board that only a service sees is listed, an absent one is not") {
    json with = status();
    with["board"]["port"] = "unix:/run/board";
    const json devices = join_devices(json::array({found_board()}), json::array(), {with});
    REQUIRE(devices["boards"].size() == 2);
    CHECK(devices["boards"][0]["used_by"].is_null());
    CHECK(devices["boards"][1]["port"] == "unix:/run/board");
    with["board"]["state"] = "absent";
    CHECK(join_devices(json::array({found_board()}), json::array(), {with})["boards"].size() == 1);
}

TEST_CASE("found_devices: there is something, or nothing") {
    const auto none = json::array();
    CHECK_FALSE(anything_found(join_devices(none, none, {})));
    CHECK(anything_found(join_devices(json::array({found_board()}), none, {})));
    CHECK(anything_found(join_devices(none, json::array({camera("22", "denied")}), {})));
}

TEST_CASE("found_devices: the table fits a terminal, and says what stands in the way") {
    json far = camera("24", "unreachable");
    far["problem"] = "its address 192.168.100.120 is not in the subnet of eth0 (10.0.0.1/24)";
    far["cure"] =
        "add an address in the camera's subnet to this host, 'sudo ip addr add "
        "192.168.100.1/24 dev eth0', or give it one with its maker's tool";
    const std::string text = devices_text(
        join_devices(json::array({found_board()}), {camera("22", "busy"), far}, {status()}));
    CHECK_THAT(text, Contains("E66164084373532B  usb:1-2  versavis 0.2.0  running, used by"));
    CHECK_THAT(text, Contains("in use\n    used by service 'default' as cam0\n"));
    CHECK_THAT(text, Contains("unreachable\n    its address") && Contains("ip addr add"));
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
        INFO(line);
        CHECK(line.size() <= 80);
    }
}

TEST_CASE("found_devices: without any, the text says what to do") {
    const std::string text = devices_text(join_devices(json::array(), json::array(), {}));
    CHECK_THAT(text, Contains("no board: plug it in") && Contains("no camera answers"));
}
