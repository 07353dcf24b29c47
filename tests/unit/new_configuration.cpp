// SPDX-License-Identifier: BSD-3-Clause
#include "discovery/new_configuration.hpp"

#include <catch2/catch.hpp>
#include <sstream>

#include "../support/temporary_directory.hpp"
#include "engine/imu/imu_model.hpp"
#include "settings/configuration.hpp"
#include "settings/key_report.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

json camera(const std::string& serial, const std::string& address,
            const std::string& access = "free") {
    return {{"serial", serial},    {"address", address},   {"device", address},
            {"vendor", "FLIR"},    {"model", "BFS"},       {"protocol", "GigE Vision"},
            {"access", access},    {"preset", "flir"},     {"mac", "aa:bb:cc:dd:ee:" + serial},
            {"problem", "is off"}, {"cure", "turn it on"}, {"user_name", "left" + serial}};
}

const json two{camera("11", "10.0.0.2"), camera("12", "10.0.0.3")};

json keys() { return json::parse(daemon::to_json(daemon::describe_keys())); }

/// What the service makes of the file; throws what is wrong with it.
daemon::Configuration loaded(const NewConfiguration& configuration) {
    const test::TemporaryDirectory directory;
    auto read = daemon::load_configuration(
        directory.write("versavis.toml", to_toml(configuration, keys())));
    if (!read) throw std::runtime_error(read.error().front().message());
    return *read;
}

}  // namespace

TEST_CASE("new_configuration: all cameras that can be used are chosen, and get names") {
    json found = two;
    found.push_back(camera("13", "10.0.0.4", "busy"));
    found.push_back(camera("14", "10.0.0.5", "busy"));
    found.back()["used_by"] = {{"instance", "default"}};
    const auto chosen = choose_cameras(found, {}, "default");
    REQUIRE(chosen);
    REQUIRE(chosen->size() == 3);
    CHECK((*chosen)[0].name == "cam0");
    CHECK((*chosen)[2].name == "cam2");
    CHECK((*chosen)[2].device == "10.0.0.5");
    CHECK((*chosen)[2].problem.empty());
}

TEST_CASE("new_configuration: cameras are chosen by any of their names, in that order") {
    for (const char* word : {"12", "10.0.0.3", "AA:BB:CC:DD:EE:12", "LEFT12"}) {
        const auto chosen = choose_cameras(two, {std::string(word) + "=right", "11"}, "default");
        REQUIRE(chosen);
        CHECK((*chosen)[0].device == "10.0.0.3");
        CHECK((*chosen)[0].name == "right");
        CHECK((*chosen)[1].name == "cam0");
    }
}

TEST_CASE("new_configuration: a name that was given is not given again") {
    const auto chosen = choose_cameras(two, {"12", "11=cam0"}, "default");
    REQUIRE(chosen);
    CHECK((*chosen)[0].name == "cam1");
}

TEST_CASE("new_configuration: a choice that is none is refused, and the error says what there is") {
    CHECK_THAT(choose_cameras(two, {"13"}, "default").error().message(),
               Contains("13: no camera") && Contains("11 at 10.0.0.2, 12 at 10.0.0.3"));
    CHECK_THAT(choose_cameras(two, {"11", "10.0.0.2"}, "default").error().message(),
               Contains("twice"));
    json many = json::array();
    for (int i = 1; i < 6; ++i)
        many.push_back(camera("1" + std::to_string(i), "10.0.0." + std::to_string(i)));
    CHECK_THAT(choose_cameras(many, {}, "default").error().message(),
               Contains("5 are too many") && Contains("--camera"));
    CHECK(choose_cameras(many, {"11", "12", "13", "14"}, "default"));
    CHECK_THAT(choose_imu("bmi088x").error().message(), Contains("icm42688p"));
}

TEST_CASE("new_configuration: what stands in the way of a chosen camera is in the file") {
    const auto chosen =
        choose_cameras(json::array({camera("13", "10.0.0.4", "unreachable")}), {"13"}, "default");
    REQUIRE(chosen);
    NewConfiguration configuration;
    configuration.cameras = *chosen;
    CHECK_THAT(to_toml(configuration, keys()),
               Contains("\n# When this was written: is off; turn it on\n[[camera]]\n"));
}

TEST_CASE(
    "new_configuration: the service takes the file, with any IMU, rate and number of "
    "cameras") {
    for (const std::string& model : imu::model_names())
        for (const double rate_hz : {0.1, 7.5, 20.0, 1000.0}) {
            NewConfiguration configuration;
            configuration.rate_hz = rate_hz;
            configuration.imu = *choose_imu(model + "=body");
            json found = two;
            found.push_back(camera("13", "10.0.0.4"));
            found.push_back(camera("14", "10.0.0.5"));
            configuration.cameras = *choose_cameras(found, {}, "default");
            INFO(model << " " << rate_hz);
            const auto read = loaded(configuration);
            CHECK(read.imus.at(0).model->name == model);
            CHECK(read.imus.at(0).name == "body");
            REQUIRE(read.cameras.size() == 4);
            CHECK(read.cameras[3].output == 3);
            CHECK(read.cameras[3].rate_hz == rate_hz);
            CHECK(read.cameras[3].device == "10.0.0.5");
        }
}

TEST_CASE("new_configuration: instance, link and board are written where they are not usual") {
    NewConfiguration configuration;
    configuration.imu = *choose_imu("vn100");
    CHECK_THAT(to_toml(configuration, keys()), !Contains("instance =") && !Contains("link ="));
    configuration.instance = "second";
    configuration.link = "unix:/run/board";
    configuration.board_serial = choose_board({{{"serial", "A"}}, {{"serial", "B"}}}, "second");
    const auto read = loaded(configuration);
    CHECK(read.instance == "second");
    CHECK(read.board.link == "unix:/run/board");
    CHECK(read.board.serial == "A");
    CHECK(choose_board({{{"serial", "A"}}}, "second").empty());
}

TEST_CASE("new_configuration: whatever a camera calls itself stays in its comment") {
    json odd = camera("13", "10.0.0.4");
    odd["vendor"] = "A\n[board]\nlink = 1\x7f";
    NewConfiguration configuration;
    configuration.cameras = *choose_cameras(json::array({odd}), {}, "default");
    configuration.cameras[0].device = "a \"quoted\" \\ name";
    const auto read = loaded(configuration);
    CHECK(read.board.link == "usb");
    CHECK(read.cameras.at(0).device == "a \"quoted\" \\ name");
}

TEST_CASE("new_configuration: each key is in the service's table, and has its meaning above it") {
    NewConfiguration configuration;
    configuration.instance = "second";
    configuration.cameras = *choose_cameras(two, {}, "default");
    configuration.imu = *choose_imu("bmi088");
    const std::string text = to_toml(configuration, keys());
    CHECK_THAT(text,
               Contains("# frames per second; need not be whole (0.1 to 1000)\nrate_hz = 20"));
    std::istringstream lines(text);
    std::string before;
    bool features = false;
    for (std::string line; std::getline(lines, line); before = line) {
        features = line == "#[camera.features]" || (features && !line.empty());
        INFO(line);
        CHECK(line.size() <= 100);
        if (!features && line.find(" = ") != std::string::npos) CHECK(before.rfind("# ", 0) == 0);
    }
}

TEST_CASE("new_configuration: what another service uses is left to it") {
    const json used = {{"instance", "other"}};
    json found = two;
    found[0]["access"] = "busy";
    found[0]["used_by"] = used;
    CHECK(choose_cameras(found, {}, "default")->front().device == "10.0.0.3");
    CHECK(choose_cameras(found, {}, "other")->front().device == "10.0.0.2");
    CHECK(choose_cameras(found, {"11"}, "default")->front().problem ==
          "the service 'other' uses it");
    const json boards = {{{"serial", "A"}, {"used_by", used}}, {{"serial", "B"}}};
    CHECK(choose_board(boards, "default") == "B");
    CHECK(choose_board(boards, "other") == "A");
}
