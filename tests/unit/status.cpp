// SPDX-License-Identifier: BSD-3-Clause
#include "stream/status.hpp"

#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "status/status_view.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

Status healthy() {
    Status status;
    status.instance = "test";
    status.now = HostTime{60'000'000'000};
    status.board.state = BoardState::running;
    status.clock.state = clock::ClockState::locked;
    CameraStatus camera;
    camera.name = "cam0";
    camera.camera.state = CameraState::streaming;
    camera.pipeline.pairing = pairing::State::locked;
    status.cameras.push_back(camera);
    ImuReport imu;
    imu.name = "imu0";
    imu.last_sample = status.now;
    status.imus.push_back(imu);
    status.streams.push_back({"cam0", "frames", 7, 20.0});
    return status;
}

/// Names of all keys, "cameras[].state" and the like.
void collect(const nlohmann::json& value, std::string prefix, std::vector<std::string>& keys) {
    if (value.is_array())
        for (const auto& entry : value) collect(entry, prefix + "[]", keys);
    if (!value.is_object()) return;
    for (const auto& [key, inner] : value.items()) {
        keys.push_back(prefix.empty() ? key : prefix + "." + key);
        collect(inner, keys.back(), keys);
    }
}

}  // namespace

TEST_CASE("status: healthy only if all that is configured delivers") {
    CHECK(health(healthy()) == "ok");
    Status status = healthy();
    status.cameras[0].pipeline.pairing = pairing::State::searching;
    CHECK(health(status) == "degraded");
    status.now = HostTime{1'000'000'000};
    CHECK(health(status) == "starting");
    status = healthy();
    status.cameras[0].triggered = false;
    status.cameras[0].pipeline.pairing = pairing::State::searching;
    CHECK(health(status) == "ok");
    status.board.state = BoardState::absent;
    CHECK(health(status) == "degraded");
    status.board_needed = false;
    CHECK(health(status) == "ok");
    status = healthy();
    status.imus[0].last_sample = HostTime{50'000'000'000};
    CHECK(health(status) == "degraded");
    status = healthy();
    status.cameras[0].stalled = true;
    CHECK(health(status) == "degraded");
    status = healthy();
    status.cameras[0].camera.state = CameraState::failed;
    CHECK(health(status) == "degraded");
}

TEST_CASE("status: what the kernel says of its clock, and whether its TAI is worth the name") {
    Status status = healthy();
    auto clock = nlohmann::json::parse(to_json(status))["clock"];
    CHECK(clock["host_synchronised"] == false);
    CHECK(clock["tai_valid"] == false);
    CHECK(clock["tai_offset_s"] == 0);
    status.clock.kernel = {true, microseconds(5), 37};
    status.clock.host_suspends = 2;
    clock = nlohmann::json::parse(to_json(status))["clock"];
    CHECK(clock["host_synchronised"] == true);
    CHECK(clock["host_max_error_ns"] == 5'000);
    CHECK(clock["tai_valid"] == true);
    CHECK(clock["tai_offset_s"] == 37);
    CHECK(clock["host_suspends"] == 2);
}

TEST_CASE("status: every key of the document is in its manual") {
    std::ifstream file(VERSAVIS_SOURCE_DIR "/docs/contracts/status.md");
    REQUIRE(file);
    std::stringstream manual;
    manual << file.rdbuf();
    std::vector<std::string> keys;
    collect(nlohmann::json::parse(to_json(healthy())), "", keys);
    CHECK(keys.size() > 50);
    for (const std::string& key : keys)
        CHECK_THAT(manual.str(), Catch::Contains("| `" + key + "` |"));
}

TEST_CASE("status: what a device says of itself cannot break the document") {
    Status status = healthy();
    status.cameras[0].camera.model = "bad \xFF\xFE \"quoted\"\n";
    const auto document = nlohmann::json::parse(to_json(status), nullptr, false);
    CHECK_FALSE(document.is_discarded());
}

TEST_CASE("status: the text for a person names what is wrong and what to do") {
    Status status = healthy();
    status.cameras[0].camera.state = CameraState::failed;
    status.cameras[0].camera.hint = "no such camera; check its cable";
    const std::string text = client::status_text(nlohmann::json::parse(to_json(status)));
    CHECK_THAT(text, Catch::Contains("degraded"));
    CHECK_THAT(text, Catch::Contains("check its cable"));
}

TEST_CASE("status: sigma of a clock that is not known is no number, least of all zero") {
    Status status = healthy();
    status.clock.state = GENERATE(clock::ClockState::init, clock::ClockState::reset);
    const auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["clock"]["sigma_ns"].is_null());
    CHECK(document["clock"]["bound_ns"].is_null());
    CHECK_THAT(client::status_text(document), Catch::Contains("sigma unknown us"));
    CHECK_THAT(client::clock_text(document), Catch::Contains("sigma                unknown"));
}

TEST_CASE("status: what was taken off for lines and filters, and what says otherwise") {
    Status status = healthy();
    PipelineReport& pipeline = status.cameras[0].pipeline;
    pipeline.lines.line = pipeline.edges.line = "Line1";
    pipeline.lines.start = {microseconds(36), microseconds(9)};
    pipeline.lines.end = {microseconds(18), microseconds(5)};
    pipeline.lines.source = DelaySource::preset;
    status.imus[0].filter = {microseconds(3662), microseconds(100), imu::DelaySource::model};
    auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["cameras"][0]["line_delay_start_ns"] == 36'000);
    CHECK(document["cameras"][0]["line_delay_sigma_ns"] == 7'000);
    CHECK(document["cameras"][0]["line_delay_source"] == "preset");
    CHECK(document["cameras"][0]["edge_difference_ns"].is_null());
    CHECK(document["imus"][0]["filter_delay_ns"] == 3'662'000);
    const std::string text = client::status_text(document);
    CHECK_THAT(text, Catch::Contains("Line1: start 36.0 us late, end 18.0 us, sigma 7.0 us"));
    CHECK_THAT(text, Catch::Contains("measured: unknown"));
    CHECK_THAT(text, Catch::Contains("filter delay 3662.0 us (model)"));
    pipeline.edges.inverted = true;
    document = nlohmann::json::parse(to_json(status));
    CHECK_THAT(document["cameras"][0]["hint"].get<std::string>(), Catch::Contains("active_low"));
}
