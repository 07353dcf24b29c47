// SPDX-License-Identifier: BSD-3-Clause
#include "status/clock_graph.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

json service_status() {
    return json::parse(R"({
        "board": {"state": "running", "health": "ok", "hint": ""},
        "clock": {"state": "locked", "health": "ok", "hint": "", "bound_ns": 41250, "pps": "used",
                  "pps_residual_ns": -1200, "second_difference_s": 0},
        "ptp": {"state": "locked", "bound_ns": 18800, "minus_utc_ns": 37000000123, "master": null,
                "contradicted": null},
        "cameras": [
            {"name": "cam0", "state": "streaming", "pairing": "locked", "trigger": "board",
             "health": "ok", "hint": "", "ptp": null},
            {"name": "cam1", "state": "streaming", "pairing": "locked", "trigger": "ptp",
             "health": "ok", "hint": "", "ptp": {"port": "Slave", "offset_ns": 120}},
            {"name": "cam2", "state": "absent", "pairing": "none", "trigger": "free",
             "health": "degraded", "hint": "no camera answers", "ptp": null}],
        "imus": [{"name": "imu0", "state": "ok", "health": "ok", "hint": ""}],
        "time_outputs": [{"name": "lidar", "state": "sending", "health": "ok", "hint": "",
                          "error_ns": 210}]})");
}

const ClockNode& find(const std::vector<ClockNode>& clocks, const std::string& name) {
    for (const ClockNode& clock : clocks)
        if (clock.name == name) return clock;
    throw std::runtime_error(name);
}

}  // namespace

TEST_CASE("clock_graph: each clock has a parent that comes before it") {
    const auto clocks = clock_graph({true, 1'500'000}, {{"a.fffe.b-1", "SLAVE", "c.fffe.d", 85}},
                                    {{"front", service_status()}, {"rear", service_status()}});
    for (std::size_t i = 0; i < clocks.size(); ++i) {
        if (i == 0) CHECK(clocks[i].parent.empty());
        bool before = i == 0;
        for (std::size_t j = 0; j < i; ++j) before = before || clocks[j].name == clocks[i].parent;
        CHECK(before);
    }
    CHECK(clocks.size() == 2 + 2 * 8);
    CHECK(find(clocks, "front/cam0").parent == "front:board");
    CHECK(find(clocks, "front/cam1").parent == "front:ptp");
    CHECK(find(clocks, "rear/cam2").parent == "host");
    CHECK(find(clocks, "rear/lidar").parent == "rear:board");
    CHECK(find(clocks, "front:pps").parent == "front:board");
}

TEST_CASE("clock_graph: bounds, offsets and states are those of the documents") {
    const auto clocks =
        clock_graph({true, 1'500'000}, {{"port", "SLAVE", "", 85}}, {{"front", service_status()}});
    CHECK(find(clocks, "host").bound_ns == 1'500'000);
    CHECK(find(clocks, "port").offset_ns == 85);
    CHECK(find(clocks, "front:board").bound_ns == 41250);
    CHECK(find(clocks, "front:ptp").bound_ns == 18800);
    CHECK(find(clocks, "front/cam1").offset_ns == 120);
    CHECK(find(clocks, "front/lidar").offset_ns == 210);
    CHECK_FALSE(find(clocks, "front/imu0").bound_ns);
    CHECK(find(clocks, "front/cam0").state == "locked");
    CHECK(find(clocks, "front/cam2").state == "absent");
    CHECK_FALSE(find(clocks, "front/cam2").good);
    const std::string text = graph_text(clocks);
    CHECK_THAT(text, Contains("front:board  exchanges with the board: locked, within 41.2 us"));
    CHECK_THAT(text, Contains("37.000 s ahead of UTC"));
    CHECK_THAT(text, Contains("absent  <- not good\n") && Contains("no camera answers\n"));
    CHECK(std::count(text.begin(), text.end(), '\n') == 2 + 8 + 1);
    const json all = graph_json(clocks);
    CHECK(all["clocks"].size() == clocks.size());
    CHECK(all["clocks"][0]["parent"].is_null());
}

TEST_CASE("clock_graph: what does not hold is not good") {
    const auto good = [](const char* name, auto change) {
        json status = service_status();
        change(status);
        return find(clock_graph({}, {}, {{"x", status}}), name).good;
    };
    CHECK_FALSE(good("x:board", [](json& s) { s["board"]["health"] = "degraded"; }));
    CHECK_FALSE(good("x:board", [](json& s) { s["clock"]["health"] = "degraded"; }));
    CHECK_FALSE(good("x:pps", [](json& s) { s["clock"]["pps"] = "lost"; }));
    CHECK_FALSE(good("x:pps", [](json& s) { s["clock"]["second_difference_s"] = 1; }));
    CHECK_FALSE(good("x:ptp", [](json& s) { s["ptp"]["master"] = "cam1"; }));
    CHECK_FALSE(good("x:ptp", [](json& s) { s["ptp"]["contradicted"] = "cam1"; }));
    CHECK_FALSE(good("x:ptp", [](json& s) { s["ptp"]["state"] = "init"; }));
    CHECK_FALSE(good("x/cam1", [](json& s) { s["cameras"][1]["health"] = "degraded"; }));
    CHECK_FALSE(find(clock_graph({}, {{"p", "LISTENING", "", {}}}, {}), "p").good);
    CHECK(find(clock_graph({}, {{"p", "MASTER", "", {}}}, {}), "p").good);
}

TEST_CASE("clock_graph: documents of other releases, and damaged ones, give what they have") {
    CHECK(clock_graph({}, {}, {{"x", json::object()}}).size() == 2);
    CHECK(clock_graph({}, {}, {{"x", json::parse(R"({"ptp": null, "cameras": 3, "board": 7,
        "clock": [], "imus": [null, 1]})")}})
              .size() >= 2);
    json unused = service_status();
    unused["board"]["state"] = "unused";
    unused["ptp"] = nullptr;
    const auto clocks = clock_graph({}, {}, {{"x", unused}});
    CHECK_THROWS(find(clocks, "x:board"));
    CHECK_FALSE(graph_text(clocks).empty());
}
