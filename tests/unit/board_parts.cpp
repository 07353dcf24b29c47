// SPDX-License-Identifier: BSD-3-Clause
#include "settings/board_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <set>

#include "../support/temporary_directory.hpp"
#include "configuration_check.hpp"
#include "engine/board/board_words.hpp"
#include "settings/board_configuration.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// Everything but the parts that are left out.
wire::BoardHello board_without(std::uint32_t parts) {
    wire::BoardHello board{};
    board.cameras = wire::camera_count;
    board.present = wire::present_all & ~parts;
    std::strcpy(board.firmware, "versavis 0.1.0");
    std::strcpy(board.serial, "B7");
    return board;
}

const std::string camera = "[[camera]]\nname = \"left\"\ndevice = \"a\"\n";
const std::string own_name = "the board (versavis 0.1.0, serial B7)";

Configuration load(const std::string& text) {
    static const test::TemporaryDirectory directory;
    const auto configuration = load_configuration(directory.write("v.toml", text));
    for (const TomlProblem& problem : configuration ? TomlProblems{} : configuration.error())
        FAIL(problem.message());
    return *configuration;
}

/// All that is missing, one message a line, without the directory.
std::string missing(const std::string& text, std::uint32_t parts) {
    std::string all;
    for (const std::string& message : missing_parts(load(text), board_without(parts)))
        all += message.substr(std::min(message.size(), message.find("v.toml"))) + "\n";
    return all;
}

}  // namespace

TEST_CASE("board_parts: a board that has all lacks nothing, whatever is asked for") {
    CHECK(
        missing(camera +
                    "[[imu]]\nmodel = \"bmi088\"\ndata_ready = true\naccel_ready = true\n"
                    "[[imu]]\nname = \"b\"\nmodel = \"vn100\"\ndata_ready = true\n"
                    "[illumination]\ncameras = [\"left\"]\n[board]\nkeep_configuration = true\n"
                    "[ports]\ninputs = [\"pps\", \"aux0\", \"aux1\", \"sync\"]\nimu_output = true\n"
                    "test = \"left\"\nsync_rate_hz = 1\n",
                0)
            .empty());
}

TEST_CASE("board_parts: what is not asked for may be missing") {
    const std::uint32_t needed = wire::present_camera0 << 1U;
    CHECK(missing(camera + "output = 1\n", ~needed).empty());
    CHECK(missing("[[imu]]\n", ~std::uint32_t{wire::present_spi}).empty());
    CHECK(missing(camera + "trigger = \"free\"\n[[imu]]\n", ~std::uint32_t{wire::present_spi})
              .empty());
}

TEST_CASE("board_parts: an output that the board lacks, and those that it has") {
    const std::string text = camera + "output = 2\n";
    const auto outputs = [](unsigned mask) { return wire::present_camera0 * mask; };
    CHECK(missing(text, outputs(0b1100)) ==
          "v.toml:4:10: 'output' of [[camera]] \"left\" is 2: " + own_name +
              " has outputs 0 and 1; use one that it has, or another board\n");
    CHECK_THAT(missing(text, outputs(0b0100)), Catch::Contains("has outputs 0, 1 and 3;"));
    CHECK_THAT(missing(text, outputs(0b1110)), Catch::Contains("has output 0;"));
    CHECK_THAT(missing(text, outputs(0b1111)), Catch::Contains("has no output 2;"));
    CHECK(missing(text, outputs(0b1011)).empty());
    // Where the file leaves it at its default, the table is its place.
    CHECK_THAT(missing(camera, outputs(1)),
               Catch::StartsWith("v.toml:1:1: 'output' of [[camera]]"));
}

TEST_CASE("board_parts: each port that the board lacks") {
    const auto told = [](const std::string& tables, std::uint32_t part) {
        return missing(camera + tables, part);
    };
    CHECK(told("[illumination]\ncameras = [\"left\"]\n", wire::present_light) ==
          "v.toml:5:11: 'cameras' of [illumination] is [\"left\"]: " + own_name +
              " has no light output; set cameras = [], or use another board\n");
    CHECK(told("[ports]\nsync_rate_hz = 2.5\n", wire::present_sync_output) ==
          "v.toml:5:16: 'sync_rate_hz' of [ports] is 2.5 Hz: " + own_name +
              " has no sync output; set sync_rate_hz = 0, or use another board\n");
    CHECK(told("[ports]\ntest = \"left\"\n", wire::present_test_output) ==
          "v.toml:5:8: 'test' of [ports] is \"left\": " + own_name +
              " has no test output; set test = \"\", or use another board\n");
    CHECK(told("[ports]\ntest_rate_hz = 1000\n", wire::present_test_output) ==
          "v.toml:5:16: 'test_rate_hz' of [ports] is 1000 Hz: " + own_name +
              " has no test output; choose another 'test_output', or use another board\n");
    CHECK(told("[ports]\ntest_rate_hz = 1\ntest_output = \"sync\"\n", wire::present_sync_output) ==
          "v.toml:6:15: 'test_output' of [ports] is \"sync\": " + own_name +
              " has no sync output; choose another, or use another board\n");
    CHECK(told("[ports]\ntest_rate_hz = 1\ntest_output = \"trigger3\"\n",
               wire::present_camera0 << 3U) ==
          "v.toml:6:15: 'test_output' of [ports] is \"trigger3\": " + own_name +
              " has outputs 0, 1 and 2; choose one that it has, or use another board\n");
    CHECK(told("[ports]\nimu_output = true\n[[imu]]\n", wire::present_imu_output) ==
          "v.toml:5:14: 'imu_output' of [ports] is true: " + own_name +
              " has no IMU output; set imu_output = false, or use another board\n");
    CHECK(told("[ports]\ninputs = [\"pps\"]\nnmea = true\n", wire::present_uart) ==
          "v.toml:6:8: 'nmea' of [ports] is true: " + own_name +
              " has no UART; set nmea = false, or use another board\n");
    CHECK(told("[board]\nkeep_configuration = true\n", wire::present_memory) ==
          "v.toml:5:22: 'keep_configuration' of [board] is true: " + own_name +
              " has no memory for it; set keep_configuration = false, or use another board\n");
}

TEST_CASE("board_parts: each input by its name, and those that the board has") {
    const std::string text = camera + "[ports]\ninputs = [\"aux1\", \"pps\", \"sync\"]\n";
    for (const auto& [name, input] : {std::pair("pps", wire::pulse_pps),
                                      {"aux1", wire::pulse_aux1},
                                      {"sync", wire::pulse_sync}})
        CHECK_THAT(missing(text, wire::present_pulse0 << input),
                   Catch::StartsWith(fmt::format("v.toml:5:10: 'inputs' of [ports] has \"{}\": {} "
                                                 "has inputs ",
                                                 name, own_name)));
    CHECK_THAT(missing(text, wire::present_pulse0 * 0b1110U),
               Catch::Contains("has \"aux1\": " + own_name +
                               " has input pps; remove it, or use another board\n") &&
                   Catch::Contains("has \"sync\": ") && !Catch::Contains("has \"pps\""));
    CHECK_THAT(missing(text, wire::present_pulse0 * 0b1111U), Catch::Contains("has no input pps;"));
    CHECK(missing(text, wire::present_pulse0 << wire::pulse_aux0).empty());
}

TEST_CASE("board_parts: the bus of an IMU, and its data-ready lines") {
    const std::string icm = "[[imu]]\nmodel = \"icm42688p\"\n";
    CHECK(missing(icm, wire::present_spi) ==
          "v.toml:1:1: 'bus' of [[imu]] is \"spi\": " + own_name +
              " has I2C and a UART for IMUs; set bus = \"i2c\" and rewire the part, or use another "
              "board\n");
    CHECK(missing(icm + "data_ready = true\nbus = \"i2c\"\n", wire::present_i2c) ==
          "v.toml:4:7: 'bus' of [[imu]] is \"i2c\": " + own_name +
              " has SPI and a UART for IMUs; set bus = \"spi\" and rewire the part, or use another "
              "board\n");
    CHECK_THAT(missing(icm, wire::present_spi | wire::present_i2c),
               Catch::Contains("has a UART for IMUs; use another part, or another board"));
    CHECK_THAT(missing("[[imu]]\n", wire::present_spi),  // it cannot be on I2C
               Catch::Contains("for IMUs; use another part, or another board"));
    CHECK_THAT(missing("[[imu]]\n", wire::present_spi | wire::present_i2c | wire::present_uart),
               Catch::Contains("has no SPI for IMUs;"));
    CHECK(missing("[[imu]]\nmodel = \"vn100\"\n", wire::present_uart) ==
          "v.toml:2:9: 'model' of [[imu]] is \"vn100\": " + own_name +
              " has SPI and I2C for IMUs; use another part, or another board\n");
    const std::string bmi = "[[imu]]\nmodel = \"bmi088\"\ndata_ready = true\naccel_ready = true\n";
    CHECK(missing(bmi, wire::present_ready0) ==
          "v.toml:3:14: 'data_ready' of [[imu]] is true: " + own_name +
              " has no data-ready input for it; set data_ready = false, or use another board\n");
    CHECK(missing(bmi, wire::present_accel_ready) ==
          "v.toml:4:15: 'accel_ready' of [[imu]] is true: " + own_name +
              " has no data-ready input for its accelerometer; set accel_ready = false, or use "
              "another board\n");
    CHECK(missing(bmi, wire::present_ready0 << 1U).empty());
    CHECK_THAT(
        missing("[[imu]]\nmodel = \"vn100\"\ndata_ready = true\n", wire::present_ready0 << 1U),
        Catch::Contains("'data_ready'"));
}

TEST_CASE("board_parts: a board without name is told as such, and all that it lacks at once") {
    wire::BoardHello bare{};
    const auto messages = missing_parts(load(camera + "[[imu]]\n"), bare);
    REQUIRE(messages.size() == 2);
    CHECK_THAT(messages[0], Catch::Contains("is 0: the board has no output 0; "));
    CHECK_THAT(messages[1], Catch::Contains("the board has no SPI for IMUs; "));
    CHECK(missing_parts({}, bare).empty());
}

TEST_CASE("board_parts: a part that the board refuses is told by its key") {
    const Configuration configuration =
        load(camera +
             "output = 2\n[[imu]]\ndata_ready = true\n[illumination]\ncameras = [\"left\"]\n"
             "[ports]\ninputs = [\"pps\", \"aux1\"]\nsync_rate_hz = 1\n");
    const auto told = [&](wire::ConfigurationPart part, unsigned index, std::int64_t value) {
        wire::Refusal refusal{};
        refusal.part = part;
        refusal.index = static_cast<std::uint8_t>(index);
        refusal.field = wire::ConfigurationField::present;
        refusal.value = value;
        return describe(configuration, refusal);
    };
    using Part = wire::ConfigurationPart;
    CHECK_THAT(
        told(Part::camera, 2, 2),
        Catch::Contains("v.toml:4:10: 'output' of [[camera]] \"left\" is 2: the board has no "
                        "output 2; use one that it has, or another board"));
    CHECK_THAT(told(Part::imu, 0, 11), Catch::Contains("'bus' of [[imu]] is \"spi\""));
    CHECK_THAT(told(Part::imu, 0, 13), Catch::Contains("'data_ready' of [[imu]] is true"));
    CHECK_THAT(told(Part::illumination, 0, 4), Catch::Contains("the board has no light output;"));
    CHECK_THAT(told(Part::ports, 0, 5), Catch::Contains("'sync_rate_hz' of [ports] is 1 Hz"));
    CHECK_THAT(told(Part::ports, 0, 9), Catch::Contains("'inputs' of [ports] has \"aux1\""));
    const std::string unasked =
        "the board lacks a part that the configuration does not ask for: update its firmware";
    for (const std::int64_t odd : {-1, 17, 64}) CHECK(told(Part::ports, 0, odd) == unasked);
    CHECK(told(Part::camera, 1, 1) == unasked);
}

namespace {

class Refusals : public firmware::RefusalSink {
 public:
    void refuse(const wire::Refusal& refusal) override { all.push_back(refusal); }
    std::vector<wire::Refusal> all;
};

}  // namespace

TEST_CASE("board_parts: what the service misses, the board refuses, and nothing else") {
    const std::string spi = "[[imu]]\nmodel = \"bmi088\"\ndata_ready = true\naccel_ready = true\n";
    const std::string i2c = "[[imu]]\nmodel = \"icm42688p\"\nbus = \"i2c\"\n";
    const std::string uart = "[[imu]]\nname = \"b\"\nmodel = \"vn100\"\ndata_ready = true\n";
    const std::string light = "[illumination]\ncameras = [\"left\"]\n";
    const std::string slave =
        "[[camera]]\nname = \"right\"\ndevice = \"b\"\noutput = 3\nmaster = \"left\"\n";
    const std::string all_inputs = "inputs = [\"pps\", \"aux0\", \"aux1\", \"sync\"]\n";
    const std::string store = "[board]\nkeep_configuration = true\n";
    const std::string texts[]{
        camera,
        camera + slave + light + spi + uart + store,
        camera + i2c + "data_ready = true\n",
        camera + spi + "[ports]\nimu_output = true\ntest = \"imu0\"\nsync_rate_hz = 1\n" +
            all_inputs,
        camera + "[ports]\nnmea = true\ntest = \"left\"\n" + all_inputs,
        camera + "[ports]\ntest_rate_hz = 5\n",
        camera + "[ports]\ntest_rate_hz = 5\ntest_output = \"sync\"\n",
        camera + slave + "[ports]\ntest_rate_hz = 5\ntest_output = \"trigger2\"\n"};
    const auto agree = [](const Configuration& configuration, std::uint32_t parts) {
        const wire::BoardHello board = board_without(parts);
        Refusals refusals;
        firmware::check(board_configuration(configuration), {board.present, 8'000'000}, refusals);
        INFO("without " << fmt::format("{}", fmt::join(board::part_names(parts), ", ")));
        CHECK(missing_parts(configuration, board).size() == refusals.all.size());
        for (const wire::Refusal& refusal : refusals.all) {
            CHECK(refusal.field == wire::ConfigurationField::present);
            CHECK_THAT(describe(configuration, refusal),
                       Catch::Contains("v.toml:") && Catch::Contains("the board has no"));
        }
    };
    for (const std::string& text : texts) {
        INFO(text);
        const Configuration configuration = load(text);
        agree(configuration, 0);
        for (std::uint32_t part = 1; part <= wire::present_memory; part <<= 1U)
            agree(configuration, part);
        agree(configuration, wire::present_all);
    }
}

TEST_CASE("board_parts: each bit has a name of its own, and those of newer boards have none") {
    const auto all = board::part_names(~0U);
    CHECK(all == board::part_names(wire::present_all));
    CHECK(all.size() == 19);
    CHECK(std::set<std::string>(all.begin(), all.end()).size() == all.size());
    CHECK(board::part_names(wire::present_light | wire::present_pulse0 << wire::pulse_sync |
                            wire::present_memory) ==
          std::vector<std::string>{"light", "sync_input", "memory"});
    CHECK(board::part_names(0).empty());
}

TEST_CASE("board_parts: what an older firmware cannot do is told by its key") {
    const std::string text =
        camera + "[clock]\nalign = true\n[ports]\ninputs = [\"pps\"]\nnmea = true\n";
    const auto told = [&](std::uint32_t capabilities) {
        return missing_capability(load(text), capabilities);
    };
    CHECK(told(wire::capability_host_grid | wire::capability_nmea).empty());
    CHECK_THAT(told(wire::capability_nmea),
               Catch::EndsWith("v.toml:5:9: 'align' of [clock] is true: the board's firmware does "
                               "not let the host place its grid; flash a newer one, or set align = "
                               "false"));
    CHECK_THAT(told(wire::capability_host_grid),
               Catch::EndsWith("v.toml:8:8: 'nmea' of [ports] is true: the board's firmware does "
                               "not read NMEA; flash a newer one, or set nmea = false"));
    CHECK(missing_capability(load(camera), 0).empty());
}
