// SPDX-License-Identifier: BSD-3-Clause
#include "health/status.hpp"

#include <catch2/catch.hpp>
#include <cerrno>
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
    status.cameras.push_back(camera);
    ImuStatus imu;
    imu.report.name = "imu0";
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

TEST_CASE("status: its summary says why, by the cause, and who else is affected") {
    Status status = healthy();
    CHECK(summary(status).text == "ok");
    status.imus[0].diagnosis = {Health::starting, Fault::starting, "not yet", {}};
    CHECK(summary(status).text == "starting: imu0: not yet");
    status.cameras[0].diagnosis = {Health::degraded, Fault::no_frames, "check its cable", {}};
    CHECK(summary(status).text == "degraded: cam0: check its cable");
    status.board_diagnosis = {Health::degraded, Fault::board_gone, "not found", {}};
    status.imus[0].diagnosis.health = Health::degraded;
    CHECK(summary(status).text == "degraded: board: not found (also degraded: cam0, imu0)");
}

TEST_CASE("status: its summary names the cause as device and fault, and whether one is dead") {
    Status status = healthy();
    status.cameras[0].delivery.rate_hz = 12;
    CHECK(summary(status).cause.empty());
    status.cameras[0].diagnosis = {Health::degraded, Fault::packet_loss, "check its cable", {}};
    CHECK(summary(status).cause == "cam0: packet_loss");
    CHECK_FALSE(summary(status).dead);  // it is the IMU that has no rate, and that is well
    status.cameras[0].delivery.rate_hz = 0;
    CHECK(summary(status).dead);
    status.cameras[0].diagnosis.health = Health::starting;
    CHECK_FALSE(summary(status).dead);
}

TEST_CASE("status: as healthy as the device that is worst off") {
    CHECK(health(healthy()) == Health::ok);
    Status status = healthy();
    Diagnosis* const all[] = {&status.board_diagnosis, &status.clock_diagnosis,
                              &status.cameras[0].diagnosis, &status.imus[0].diagnosis};
    for (Diagnosis* diagnosis : all) {
        diagnosis->health = Health::starting;
        CHECK(health(status) == Health::starting);
        diagnosis->health = Health::degraded;
        CHECK(health(status) == Health::degraded);
        CHECK(nlohmann::json::parse(to_json(status))["health"] == "degraded");
        diagnosis->health = Health::ok;
    }
}

TEST_CASE("status: each device has health, state, fault, since when, and what to do") {
    Status status = healthy();
    status.imus[0].diagnosis = {Health::degraded, Fault::imu_missing, "plug it in", HostTime{7}};
    const auto document = nlohmann::json::parse(to_json(status));
    for (const auto& device :
         {document["board"], document["clock"], document["cameras"][0], document["imus"][0]})
        for (const char* key : {"health", "state", "fault", "since_ns", "hint"})
            CHECK(device.contains(key));
    CHECK(document["imus"][0]["health"] == "degraded");
    CHECK(document["imus"][0]["fault"] == "imu_missing");
    CHECK(document["imus"][0]["since_ns"] == 7);
    CHECK(document["imus"][0]["hint"] == "plug it in");
    CHECK(document["cameras"][0]["fault"] == "");
}

TEST_CASE("status: what a time output sent last, if anything") {
    Status status = healthy();
    CHECK(nlohmann::json::parse(to_json(status))["time_outputs"].empty());
    status.time_outputs.push_back({{"roof", TimeOutputState::waiting, "", 0, 0, {}}});
    auto output = nlohmann::json::parse(to_json(status))["time_outputs"][0];
    CHECK(output["name"] == "roof");
    CHECK(output["state"] == "waiting");
    CHECK(output["utc_s"].is_null());
    CHECK(output["error_ns"].is_null());
    status.time_outputs[0].report = {"roof",        TimeOutputState::sending, "", 7, 1'798'761'600,
                                     Duration{-250}};
    output = nlohmann::json::parse(to_json(status))["time_outputs"][0];
    CHECK(output["pulses"] == 7);
    CHECK(output["utc_s"] == 1'798'761'600);
    CHECK(output["error_ns"] == -250);
    CHECK(output["health"] == "ok");
    status.time_outputs[0].diagnosis = {Health::degraded, Fault::time_silent, "", {}};
    CHECK(health(status) == Health::degraded);
}

TEST_CASE("status: LiDARs as they were reported, and the worst of them counts") {
    Status status = healthy();
    CHECK(nlohmann::json::parse(to_json(status))["lidars"].empty());
    status.lidars.push_back({{"10.0.0.3", "Livox", "follows", "", microseconds(301), {}}});
    const auto lidar = nlohmann::json::parse(to_json(status))["lidars"][0];
    CHECK(lidar["name"] == "10.0.0.3");
    CHECK(lidar["maker"] == "Livox");
    CHECK(lidar["state"] == "follows");
    CHECK(lidar["behind_ns"] == 301'000);
    CHECK(lidar["ahead_ns"].is_null());
    CHECK(health(status) == Health::ok);
    status.lidars[0].diagnosis = {Health::degraded, Fault::lidar_not_following, "", {}};
    CHECK(health(status) == Health::degraded);
}

TEST_CASE("status: how packets are received, once that is decided") {
    Status status = healthy();
    const auto receive = [&] {
        return nlohmann::json::parse(to_json(status))["cameras"][0]["receive"];
    };
    CHECK(receive() == "");
    status.cameras[0].camera.receive = ReceiveMode::packet;
    CHECK(receive() == "packet");
    status.cameras[0].camera.receive = ReceiveMode::socket;
    CHECK(receive() == "socket");
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
    status.clock.kernel.error = EPERM;
    clock = nlohmann::json::parse(to_json(status))["clock"];
    CHECK(clock["host_synchronised"].is_null());
    CHECK(clock["host_max_error_ns"].is_null());
    CHECK(clock["tai_offset_s"] == 37);
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
    status.cameras[0].diagnosis = {Health::degraded, Fault::camera_absent,
                                   "no camera answers to this name; check its cable", status.now};
    const std::string text =
        client::status_text(nlohmann::json::parse(to_json(status)), client::Detail::full);
    CHECK_THAT(text, Catch::Contains("degraded"));
    CHECK_THAT(text, Catch::Contains("check its cable"));
}

TEST_CASE("status: what a board has is named, and of one that was never met nothing is claimed") {
    Status status = healthy();
    auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["board"]["present"].is_null());
    CHECK(document["board"]["fastest_imu_hz"].is_null());
    CHECK_THAT(client::status_text(document, client::Detail::full), !Catch::Contains("it has"));
    status.board.connections = 1;
    status.board.present = wire::present_camera0 | wire::present_spi | wire::present_ready0 << 1U;
    status.board.fastest_imu_millihertz = 2'048'500;
    document = nlohmann::json::parse(to_json(status));
    CHECK(document["board"]["present"] == nlohmann::json({"camera0", "spi", "imu1_ready"}));
    CHECK(document["board"]["fastest_imu_hz"] == 2048.5);
    CHECK_THAT(client::status_text(document, client::Detail::full),
               Catch::Contains("it has camera0, spi, imu1_ready; IMUs up to 2048.5 Hz\n"));
}

TEST_CASE("status: firmware of an older release is reported, and of a board never met nothing") {
    Status status = healthy();
    status.release = "0.2.0";
    status.configuration = "/etc/versavis/versavis.toml";
    status.board.firmware = "versavis 0.1.9";
    const auto outdated = [&] {
        const auto document = nlohmann::json::parse(to_json(status));
        CHECK(document["release"] == "0.2.0");
        CHECK(document["configuration"] == "/etc/versavis/versavis.toml");
        return document["board"]["firmware_outdated"];
    };
    CHECK(outdated().is_null());
    status.board.connections = 1;
    CHECK(outdated() == true);
    status.board.firmware = "versavis 0.2.0";
    CHECK(outdated() == false);
}

TEST_CASE("status: the board's clock against PPS is known while PPS is good, and not else") {
    Status status = healthy();
    status.board.health.pps_error_ppb = -250;
    for (const auto state : {wire::PpsState::none, wire::PpsState::acquiring}) {
        status.board.health.pps_state = state;
        const auto document = nlohmann::json::parse(to_json(status));
        CHECK(document["board"]["pps_error_ppb"].is_null());
        CHECK_THAT(client::clock_text(document), !Catch::Contains("ppb"));
    }
    status.board.health.pps_state = wire::PpsState::good;
    const auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["board"]["pps_error_ppb"] == -250);
    CHECK_THAT(client::clock_text(document), Catch::Contains("-250 ppb"));
}

TEST_CASE("status: what the board proves of its stamps") {
    Status status = healthy();
    for (const auto& [test, word] : {std::pair(wire::StampTest::none, "none"),
                                     {wire::StampTest::failed, "failed"},
                                     {wire::StampTest::passed, "passed"}}) {
        status.board.health.stamp_test = test;
        CHECK(nlohmann::json::parse(to_json(status))["board"]["stamp_test"] == word);
    }
}

TEST_CASE("status: pulses of the sync input, glitches and repeated samples") {
    Status status = healthy();
    status.board.health.glitches = 12;
    status.imus[0].report.repeated = 3;
    for (const auto& [state, word] : {std::pair(wire::SyncState::none, "none"),
                                      {wire::SyncState::lost, "lost"},
                                      {wire::SyncState::followed, "followed"}}) {
        status.board.health.sync_state = state;
        const auto document = nlohmann::json::parse(to_json(status));
        CHECK(document["board"]["sync"] == word);
        CHECK(document["board"]["glitches"] == 12);
        CHECK(document["imus"][0]["repeated"] == 3);
    }
    status.board.awaits_sync = true;
    CHECK(nlohmann::json::parse(to_json(status))["board"]["sync"] == "awaited");
}

TEST_CASE("status: sigma of a clock that is not known is no number, least of all zero") {
    Status status = healthy();
    status.clock.state = GENERATE(clock::ClockState::init, clock::ClockState::reset);
    const auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["clock"]["sigma_ns"].is_null());
    CHECK(document["clock"]["bound_ns"].is_null());
    CHECK_THAT(client::status_text(document, client::Detail::full),
               Catch::Contains("realtime  unknown"));
    CHECK_THAT(client::clock_text(document), Catch::Contains("sigma                unknown"));
}

TEST_CASE("status: what was taken off for lines and filters, and what says otherwise") {
    Status status = healthy();
    PipelineReport& pipeline = status.cameras[0].pipeline;
    pipeline.lines.line = pipeline.edges.line = "Line1";
    pipeline.lines.start = {microseconds(36), microseconds(9)};
    pipeline.lines.end = {microseconds(18), microseconds(5)};
    pipeline.lines.source = DelaySource::preset;
    status.imus[0].report.filter = {microseconds(3662), microseconds(100),
                                    imu::FilterDelaySource::model};
    const auto document = nlohmann::json::parse(to_json(status));
    CHECK(document["cameras"][0]["line_delay_start_ns"] == 36'000);
    CHECK(document["cameras"][0]["line_delay_sigma_ns"] == 7'000);
    CHECK(document["cameras"][0]["line_delay_source"] == "preset");
    CHECK(document["cameras"][0]["edge_difference_ns"].is_null());
    CHECK(document["imus"][0]["filter_delay_ns"] == 3'662'000);
    const std::string text = client::status_text(document, client::Detail::full);
    CHECK_THAT(text, Catch::Contains("Line1: start 36.0 us late, end 18.0 us, sigma 7.0 us"));
    CHECK_THAT(text, Catch::Contains("measured: unknown"));
    CHECK_THAT(text, Catch::Contains("filter delay 3662.0 us (model)"));
}
