// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_view.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <sstream>

using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

TEST_CASE("status_view: each fact of the clock has a name and a unit") {
    const std::string text =
        clock_text(json::parse(R"({"board": {"pps": "good", "pps_error_ppb": -120},
        "clock": {"state": "locked", "output": "tai", "sigma_ns": 4500, "skew_ppm": -12.34567,
                  "output_minus_host_ns": 1700000000000000000, "exchanges": 17}})"));
    CHECK_THAT(text, Contains("state                locked\n"));
    CHECK_THAT(text, Contains("sigma                4.5 us "));
    CHECK_THAT(text, Contains("-12.3457 ppm"));
    CHECK_THAT(text, Contains("1700000000.000000 s"));
    CHECK_THAT(text, Contains("exchanges            17 "));
    CHECK_THAT(text, Contains("board against PPS    -120 ppb"));
}

TEST_CASE("status_view: keys of the clock that are not known yet are shown by their names") {
    const std::string text = clock_text(
        json::parse(R"({"clock": {"later": {"residual_ns": -250, "state": "good"}, "other_ns": 2500,
                                  "since_then_s": 0.25, "really": true, "label": null}})"));
    CHECK_THAT(text,
               Contains("later.residual_ns    -0.2") && Contains("later.state          good\n"));
    CHECK_THAT(text, Contains("other_ns             2.5 us\n"));
    CHECK_THAT(text,
               Contains("since_then_s         0.2 s\n") && Contains("really               true\n"));
    CHECK(clock_text(json::object()).empty());
}

TEST_CASE("status_view: a time output shows the newest second and its error") {
    json status = json::parse(R"({"instance": "a", "health": "ok", "time_outputs": [
        {"name": "roof", "state": "sending", "health": "ok", "fault": "", "hint": "", "pulses": 7,
         "utc_s": 1798761600, "error_ns": -250}]})");
    const auto shown = [&] { return status_text(status, Detail::summary, Colour::none); };
    CHECK_THAT(shown(),
               Contains("roof     sending    2027-01-01 00:00:00 UTC, -0.2 us off, 7 pulses"));
    status["time_outputs"][0]["utc_s"] = nullptr;
    status["time_outputs"][0]["error_ns"] = nullptr;
    status["time_outputs"][0]["state"] = "waiting";
    status["time_outputs"][0]["hint"] = "the board's clock is not known yet";
    CHECK_THAT(shown(), Contains("roof     waiting    no pulse yet") &&
                            Contains("the board's clock is not known yet"));
}

namespace {

/// Four cameras and an IMU, all of which have been through trouble, and have the same hint, as long
/// as any.
json troubled() {
    json status = json::parse(R"({"instance": "default", "health": "degraded",
        "started_ns": 0, "host_time_ns": 432000000000000,
        "board": {"state": "running", "serial": "E66164084373532B", "firmware": "versavis 0.2.0",
                  "lost_packets": 12, "late_outputs": 3, "imu_errors": 14,
                  "present": ["camera0", "camera1", "camera2", "camera3", "light", "spi"],
                  "fastest_imu_hz": 8000},
        "clock": {"state": "locked", "output": "realtime", "sigma_ns": 4520, "bound_ns": 123456,
                  "skew_ppm": -12.345, "round_trip_ns": 345000},
        "imus": [{"name": "imu0", "state": "running", "model": "adis16448", "delivered_hz": 200.02,
                  "configured_hz": 200, "published": 86400000, "lost": 3, "faulty": 12,
                  "filter_delay_ns": 3662000, "filter_delay_source": "model"}]})");
    const json camera = json::parse(R"({"state": "streaming", "model": "acA1300-75gm",
        "delivered_hz": 14.5, "configured_hz": 20, "pairing": "searching",
        "frames_published": 8640000, "frames_incomplete": 1234, "frames_without_trigger": 4567,
        "triggers_without_frame": 4711, "slips": 89, "line": "Line2", "line_delay_start_ns": 36000,
        "line_delay_end_ns": 18000, "line_delay_sigma_ns": 7000, "line_delay_source": "preset",
        "edge_difference_ns": -18100})");
    for (const char* name : {"cam0", "cam1", "cam2", "cam3"}) {
        status["cameras"].push_back(camera);
        status["cameras"].back()["name"] = name;
    }
    const std::string longest =
        "takes every 2nd trigger: exposure (3 ms) and readout need more than 50 ms, and at most "
        "100 ms: lower 'rate_hz' to 10, shorten ExposureTime, or set TriggerOverlap to ReadOut";
    std::vector<json*> devices{&status["board"], &status["clock"], &status["imus"][0]};
    for (json& each : status["cameras"]) devices.push_back(&each);
    for (json* device : devices) {
        (*device)["fault"] = "rate_too_high";
        (*device)["hint"] = longest;
    }
    for (const char* name : {"cam0", "cam0-evidence", "cam1", "cam1-evidence", "imu0", "events"})
        status["streams"].push_back(
            {{"name", name}, {"kind", "frames"}, {"items", 86400000}, {"rate_hz", 20.0}});
    return status;
}

std::vector<std::string> lines(const std::string& text) {
    std::istringstream in(text);
    std::vector<std::string> out;
    for (std::string line; std::getline(in, line);) out.push_back(line);
    return out;
}

}  // namespace

TEST_CASE("status_view: the state of four cameras and an IMU fits a terminal") {
    for (const Detail detail : {Detail::summary, Detail::full})
        for (const std::string& line : lines(status_text(troubled(), detail))) {
            INFO(line);
            CHECK(line.size() <= 80);
            CHECK(line.find_last_not_of(' ') + 1 == line.size());
        }
    CHECK(lines(status_text(troubled(), Detail::summary)).size() <= 24);
}

TEST_CASE("status_view: long lines are continued below their first words, and lose none") {
    std::string text = status_text(troubled(), Detail::summary);
    CHECK_THAT(text,
               Contains("rate_too_high: takes every 2nd trigger: exposure (3 ms) and readout\n"
                        "         need more than 50 ms"));
    json odd = troubled();
    odd["board"]["hint"] = std::string(200, 'x') + " y";
    CHECK_THAT(status_text(odd, Detail::summary),
               Contains(std::string(200, 'x') + "\n         y\n"));
}

TEST_CASE(
    "status_view: a summary has the counters that say something, all else is for the curious") {
    json status = troubled();
    for (const char* key : {"frames_incomplete", "slips"}) status["cameras"][0][key] = 0;
    status["cameras"] = json::array({status["cameras"][0]});
    const std::string summary = status_text(status, Detail::summary);
    CHECK_THAT(summary, Contains("trigger 4567") && !Contains("incomplete") && !Contains("slips") &&
                            !Contains("Line2") && !Contains("stream  ") && !Contains("it has") &&
                            !Contains("filter delay"));
    const std::string full = status_text(status, Detail::full);
    CHECK_THAT(full, Contains("incomplete 0") && Contains("slips 0") && Contains("Line2: start") &&
                         Contains("stream   cam0-evidence") && Contains("it has camera0") &&
                         Contains("filter delay 3662.0 us"));
}

TEST_CASE("status_view: one hint of several devices is said once") {
    const std::string text = status_text(troubled(), Detail::summary);
    CHECK(text.find("takes every 2nd") == text.rfind("takes every 2nd"));
    CHECK_THAT(text, Contains("rate_too_high: as board\n"));
}

TEST_CASE("status_view: colours are those of the states, and change nothing else") {
    json status = troubled();
    status["health"] = "ok";
    status["cameras"][0]["fault"] = status["cameras"][0]["hint"] = "";
    status["cameras"][1]["fault"] = "starting";
    status["cameras"][2]["fault"] = "";
    std::string text = status_text(status, Detail::summary, Colour::ansi);
    CHECK_THAT(text, Contains("'default': \x1b[32mok\x1b[0m, up"));
    CHECK_THAT(text, Contains("cam0     \x1b[32mstreaming\x1b[0m ") &&
                         Contains("cam1     \x1b[33mstreaming\x1b[0m ") &&
                         Contains("cam2     \x1b[33mstreaming\x1b[0m ") &&
                         Contains("cam3     \x1b[31mstreaming\x1b[0m "));
    for (std::size_t at = 0; (at = text.find('\x1b', at)) != std::string::npos;)
        text.erase(at, text.find('m', at) + 1 - at);
    CHECK(text == status_text(status, Detail::summary));
}

TEST_CASE("status_view: a watched state replaces the one before line by line") {
    CHECK(in_place("a\nbc\n") == "\x1b[Ha\x1b[K\nbc\x1b[K\n\x1b[J");
}
