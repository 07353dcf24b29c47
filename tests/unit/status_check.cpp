// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_check.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

/// A camera and an IMU that deliver.
json well() {
    return json::parse(R"({"health": "ok",
        "board": {"health": "ok", "fault": "", "hint": ""},
        "clock": {"health": "ok", "fault": "", "hint": "", "sigma_ns": 4500},
        "cameras": [{"name": "cam0", "health": "ok", "fault": "", "hint": "",
                     "delivered_hz": 20.04, "frames_incomplete": 3, "frames_without_trigger": 1}],
        "imus": [{"name": "imu0", "health": "ok", "fault": "", "hint": "", "delivered_hz": 200,
                  "lost": 0}]})");
}

json& degrade(json& status, const char* kind, const char* hint) {
    json& device = status[kind][0];
    status["health"] = device["health"] = "degraded";
    device["fault"] = "packet_loss";
    device["hint"] = hint;
    return device;
}

}  // namespace

TEST_CASE("status_check: what is well is one line with performance data") {
    const CheckResult result = check_status(well());
    CHECK(result.state == CheckState::ok);
    CHECK(result.line ==
          "VERSAVIS OK - 1 camera, 1 IMU | cam0_rate=20.0 cam0_incomplete=3c cam0_unproved=1c "
          "imu0_rate=200.0 imu0_lost=0c clock_sigma=0.000004500s");
}

TEST_CASE("status_check: a device that delivers too little is a warning, with its hint") {
    json status = well();
    degrade(status, "cameras", "7 | 8\nframes");
    degrade(status, "imus", "its own");
    const CheckResult result = check_status(status);
    CHECK(result.state == CheckState::warning);
    // Whatever a device is called by its maker: the line has one bar, and is one line.
    CHECK_THAT(result.line, Contains("WARNING - cam0: packet_loss: 7   8 frames (also: imu0) | "));
}

TEST_CASE("status_check: a device that delivers nothing is critical") {
    json status = well();
    degrade(status, "imus", "nothing comes")["delivered_hz"] = 0;
    CHECK(check_status(status).state == CheckState::critical);
}

TEST_CASE("status_check: a device without a rate is a warning") {
    json status = well();
    status["time_outputs"] = {{{"name", "lidar"}, {"state", "waiting"}}};
    degrade(status, "time_outputs", "the board's clock is not known yet");
    const CheckResult result = check_status(status);
    CHECK(result.state == CheckState::warning);
    CHECK_THAT(result.line, Contains("WARNING - lidar: packet_loss: the board's clock"));
}

TEST_CASE("status_check: of a start, and of an unknown clock, nothing is claimed") {
    json status = well();
    status["health"] = status["clock"]["health"] = "starting";
    status["clock"]["fault"] = "clock_unknown";
    status["clock"]["sigma_ns"] = nullptr;
    const CheckResult result = check_status(status);
    CHECK(result.state == CheckState::unknown);
    CHECK_THAT(result.line, Contains("starting: clock: clock_unknown") && !Contains("sigma"));
}

TEST_CASE("status_check: a dead service is critical, an unreadable status is unknown") {
    const Error error{"instance car", "the service has died", ""};
    CHECK(check_failed(error, false).state == CheckState::critical);
    CHECK(check_failed(error, true).state == CheckState::unknown);
    CHECK(check_failed(error, true).line ==
          "VERSAVIS UNKNOWN - instance car: the service has died");
}

TEST_CASE("status_check: labels with blanks are quoted") {
    json status = well();
    status["cameras"][0]["name"] = "left eye";
    CHECK_THAT(check_status(status).line, Contains("'left eye_rate'=20.0 "));
}
