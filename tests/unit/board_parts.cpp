// SPDX-License-Identifier: BSD-3-Clause
#include "settings/board_parts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

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
    std::strcpy(board.firmware, "v1");
    std::strcpy(board.serial, "B7");
    return board;
}

const std::string left_section = "[[camera]]\nname = 'left'\ndevice = 'a'\n";

Configuration load_parts(const std::string& text) {
    static const test::TemporaryDirectory directory;
    const auto configuration = load_configuration(directory.write("v.toml", text));
    for (const TomlProblem& problem : configuration ? TomlProblems{} : configuration.error())
        FAIL(problem.message());
    return *configuration;
}

/// A message from the place in its file on.
std::string from_place(const std::string& message) {
    const std::string file = "v.toml:";
    const auto at = message.find(file);
    return at == std::string::npos ? message : message.substr(at + file.size());
}

struct Lack {
    std::string text;     ///< of the configuration
    std::uint32_t parts;  ///< that the board lacks
    std::string message;  ///< the whole of it; several: one a line; empty: none
};

void check_lacks(const std::vector<Lack>& rows) {
    for (const auto& [text, parts, message] : rows) {
        INFO(text);
        INFO("without " << fmt::format("{}", fmt::join(board::part_names(parts), ", ")));
        std::vector<std::string> all;
        for (const std::string& one : missing_parts(load_parts(text), board_without(parts)))
            all.push_back(from_place(one));
        CHECK(fmt::format("{}", fmt::join(all, "\n")) == message);
    }
}

constexpr std::uint32_t outputs(unsigned mask) { return wire::present_camera0 * mask; }
constexpr std::uint32_t inputs(unsigned mask) { return wire::present_pulse0 * mask; }

}  // namespace

TEST_CASE("board_parts: what is not used may be missing") {
    const std::string all =
        "[[imu]]\nmodel = 'bmi088'\ndata_ready = true\naccel_ready = true\n"
        "[[imu]]\nname = 'b'\nmodel = 'vn100'\ndata_ready = true\n"
        "[illumination]\ncameras = ['left']\n[board]\nkeep_configuration = true\n"
        "[ports]\ninputs = ['pps', 'aux0', 'aux1', 'sync']\nimu_output = true\n"
        "test = 'left'\nsync_rate_hz = 1\n";
    check_lacks(
        {{left_section + all, 0, ""},
         {left_section + "output = 1\n", ~outputs(0b0010), ""},
         {"[[imu]]\n", ~std::uint32_t{wire::present_spi}, ""},
         {left_section + "trigger = 'free'\n[[imu]]\n", ~std::uint32_t{wire::present_spi}, ""}});
}

TEST_CASE("board_parts: a missing trigger output, with those that the board has") {
    const std::string text = left_section + "output = 2\n";
    check_lacks(
        {{text, outputs(0b1100),
          "4:10: 'output' of [[camera]] \"left\" is 2: the board (v1, serial B7) has outputs 0 "
          "and 1; use one that it has, or another board"},
         {text, outputs(0b0100),
          "4:10: 'output' of [[camera]] \"left\" is 2: the board (v1, serial B7) has outputs 0, "
          "1 and 3; use one that it has, or another board"},
         {text, outputs(0b1110),
          "4:10: 'output' of [[camera]] \"left\" is 2: the board (v1, serial B7) has output 0; "
          "use one that it has, or another board"},
         {text, outputs(0b1111),
          "4:10: 'output' of [[camera]] \"left\" is 2: the board (v1, serial B7) has no output "
          "2; use one that it has, or another board"},
         {text, outputs(0b1011), ""},
         // Where the key is not in the file, its table is the place.
         {left_section, outputs(0b0001),
          "1:1: 'output' of [[camera]] \"left\" is 0: the board (v1, serial B7) has outputs 1, 2 "
          "and 3; use one that it has, or another board"}});
}

TEST_CASE("board_parts: a missing port") {
    const std::string ports = left_section + "[ports]\n";
    const std::string three = ports + "inputs = ['aux1', 'pps', 'sync']\n";
    check_lacks(
        {{left_section + "[illumination]\ncameras = ['left']\n", wire::present_light,
          "5:11: 'cameras' of [illumination] is [\"left\"]: the board (v1, serial B7) has no "
          "light output; set cameras = [], or use another board"},
         {left_section + "[board]\nkeep_configuration = true\n", wire::present_memory,
          "5:22: 'keep_configuration' of [board] is true: the board (v1, serial B7) has no "
          "memory to store it; set keep_configuration = false, or use another board"},
         {ports + "sync_rate_hz = 2.5\n", wire::present_sync_output,
          "5:16: 'sync_rate_hz' of [ports] is 2.5 Hz: the board (v1, serial B7) has no sync "
          "output; set sync_rate_hz = 0, or use another board"},
         {ports + "test = 'left'\n", wire::present_test_output,
          "5:8: 'test' of [ports] is \"left\": the board (v1, serial B7) has no test output; set "
          "test = \"\", or use another board"},
         {ports + "test_rate_hz = 1000\n", wire::present_test_output,
          "5:16: 'test_rate_hz' of [ports] is 1000 Hz: the board (v1, serial B7) has no test "
          "output; choose another 'test_output', or use another board"},
         {ports + "test_rate_hz = 1\ntest_output = 'sync'\n", wire::present_sync_output,
          "6:15: 'test_output' of [ports] is \"sync\": the board (v1, serial B7) has no sync "
          "output; choose another output, or use another board"},
         {ports + "test_rate_hz = 1\ntest_output = 'trigger3'\n", outputs(0b1000),
          "6:15: 'test_output' of [ports] is \"trigger3\": the board (v1, serial B7) has outputs "
          "0, 1 and 2; choose one that it has, or use another board"},
         {ports + "imu_output = true\n[[imu]]\n", wire::present_imu_output,
          "5:14: 'imu_output' of [ports] is true: the board (v1, serial B7) has no IMU output; "
          "set imu_output = false, or use another board"},
         {ports + "inputs = ['pps']\nnmea = true\n", wire::present_uart,
          "6:8: 'nmea' of [ports] is true: the board (v1, serial B7) has no UART; set nmea = "
          "false, or use another board"},
         {three, wire::present_pulse0 << wire::pulse_pps,
          "5:10: 'inputs' of [ports] has \"pps\": the board (v1, serial B7) has inputs aux0, "
          "aux1 and sync; remove it, or use another board"},
         {three, wire::present_pulse0 << wire::pulse_aux0, ""},
         {three, wire::present_pulse0 << wire::pulse_aux1,
          "5:10: 'inputs' of [ports] has \"aux1\": the board (v1, serial B7) has inputs pps, "
          "aux0 and sync; remove it, or use another board"},
         {three, wire::present_pulse0 << wire::pulse_sync,
          "5:10: 'inputs' of [ports] has \"sync\": the board (v1, serial B7) has inputs pps, "
          "aux0 and aux1; remove it, or use another board"},
         {three, inputs(0b1110),
          "5:10: 'inputs' of [ports] has \"aux1\": the board (v1, serial B7) has input pps; "
          "remove it, or use another board\n"
          "5:10: 'inputs' of [ports] has \"sync\": the board (v1, serial B7) has input pps; "
          "remove it, or use another board"},
         {three, inputs(0b1111),
          "5:10: 'inputs' of [ports] has \"pps\": the board (v1, serial B7) has no input pps; "
          "remove it, or use another board\n"
          "5:10: 'inputs' of [ports] has \"aux1\": the board (v1, serial B7) has no input aux1; "
          "remove it, or use another board\n"
          "5:10: 'inputs' of [ports] has \"sync\": the board (v1, serial B7) has no input sync; "
          "remove it, or use another board"}});
}

TEST_CASE("board_parts: a missing bus or data-ready line of an IMU") {
    const std::string icm = "[[imu]]\nmodel = 'icm42688p'\n";
    const std::string bmi = "[[imu]]\nmodel = 'bmi088'\ndata_ready = true\naccel_ready = true\n";
    const std::string vn = "[[imu]]\nmodel = 'vn100'\n";
    check_lacks(
        {{icm, wire::present_spi,
          "1:1: 'bus' of [[imu]] is \"spi\": the board (v1, serial B7) has I2C and a UART for "
          "IMUs; set bus = \"i2c\" and rewire the part, or use another board"},
         {icm + "data_ready = true\nbus = 'i2c'\n", wire::present_i2c,
          "4:7: 'bus' of [[imu]] is \"i2c\": the board (v1, serial B7) has SPI and a UART for "
          "IMUs; set bus = \"spi\" and rewire the part, or use another board"},
         {icm, wire::present_spi | wire::present_i2c,
          "1:1: 'bus' of [[imu]] is \"spi\": the board (v1, serial B7) has a UART for IMUs; use "
          "another part, or another board"},
         {"[[imu]]\n", wire::present_spi,
          "1:1: 'bus' of [[imu]] is \"spi\": the board (v1, serial B7) has I2C and a UART for "
          "IMUs; use another part, or another board"},  // it cannot be on I2C
         {"[[imu]]\n", wire::present_spi | wire::present_i2c | wire::present_uart,
          "1:1: 'bus' of [[imu]] is \"spi\": the board (v1, serial B7) has no SPI for IMUs; use "
          "another part, or another board"},
         {vn, wire::present_uart,
          "2:9: 'model' of [[imu]] is \"vn100\": the board (v1, serial B7) has SPI and I2C for "
          "IMUs; use another part, or another board"},
         {vn + "data_ready = true\n", wire::present_ready0 << 1U,
          "3:14: 'data_ready' of [[imu]] is true: the board (v1, serial B7) has no data-ready "
          "input for it; set data_ready = false, or use another board"},
         {bmi, wire::present_ready0,
          "3:14: 'data_ready' of [[imu]] is true: the board (v1, serial B7) has no data-ready "
          "input for it; set data_ready = false, or use another board"},
         {bmi, wire::present_accel_ready,
          "4:15: 'accel_ready' of [[imu]] is true: the board (v1, serial B7) has no data-ready "
          "input for its accelerometer; set accel_ready = false, or use another board"},
         {bmi, wire::present_ready0 << 1U, ""}});
}

TEST_CASE("board_parts: a board without a name, and all that it lacks at once") {
    const wire::BoardHello bare{};
    const auto messages = missing_parts(load_parts(left_section + "[[imu]]\n"), bare);
    REQUIRE(messages.size() == 2);
    CHECK(from_place(messages[0]) ==
          "1:1: 'output' of [[camera]] \"left\" is 0: the board has no output 0; use one that it "
          "has, or another board");
    CHECK(from_place(messages[1]) ==
          "4:1: 'bus' of [[imu]] is \"spi\": the board has no SPI for IMUs; use another part, or "
          "another board");
    CHECK(missing_parts({}, bare).empty());
}

TEST_CASE("board_parts: a part that the board refuses is named by its key") {
    using Part = wire::ConfigurationPart;
    const Configuration configuration =
        load_parts(left_section +
                   "output = 2\n[[imu]]\ndata_ready = true\n[illumination]\ncameras = ['left']\n"
                   "[ports]\ninputs = ['pps', 'aux1']\nsync_rate_hz = 1\n");
    const std::string unused =
        "the board reports a missing part that the configuration does not use: update its firmware";
    const struct {
        Part part;
        unsigned index;
        std::int64_t value;
        std::string message;
    } rows[]{{Part::camera, 2, 2,
              "4:10: 'output' of [[camera]] \"left\" is 2: the board has no output 2; use one that "
              "it has, or another board"},
             {Part::imu, 0, 11,
              "5:1: 'bus' of [[imu]] is \"spi\": the board has no SPI for IMUs; use another part, "
              "or another board"},
             {Part::imu, 0, 13,
              "6:14: 'data_ready' of [[imu]] is true: the board has no data-ready input for it; "
              "set data_ready = false, or use another board"},
             {Part::illumination, 0, 4,
              "8:11: 'cameras' of [illumination] is [\"left\"]: the board has no light output; set "
              "cameras = [], or use another board"},
             {Part::ports, 0, 5,
              "11:16: 'sync_rate_hz' of [ports] is 1 Hz: the board has no sync output; set "
              "sync_rate_hz = 0, or use another board"},
             {Part::ports, 0, 9,
              "10:10: 'inputs' of [ports] has \"aux1\": the board has no input aux1; remove it, or "
              "use another board"},
             {Part::ports, 0, -1, unused},
             {Part::ports, 0, 17, unused},
             {Part::ports, 0, 64, unused},
             {Part::camera, 1, 1, unused}};
    for (const auto& [part, index, value, message] : rows) {
        wire::Refusal refusal{};
        refusal.part = part;
        refusal.index = static_cast<std::uint8_t>(index);
        refusal.field = wire::ConfigurationField::present;
        refusal.value = value;
        CAPTURE(part, index, value);
        CHECK(from_place(describe(configuration, refusal)) == message);
    }
}

namespace {

class PartRefusals : public firmware::RefusalSink {
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
        left_section,
        left_section + slave + light + spi + uart + store,
        left_section + i2c + "data_ready = true\n",
        left_section + spi + "[ports]\nimu_output = true\ntest = \"imu0\"\nsync_rate_hz = 1\n" +
            all_inputs,
        left_section + "[ports]\nnmea = true\ntest = \"left\"\n" + all_inputs,
        left_section + "[ports]\ntest_rate_hz = 5\n",
        left_section + "[ports]\ntest_rate_hz = 5\ntest_output = \"sync\"\n",
        left_section + slave + "[ports]\ntest_rate_hz = 5\ntest_output = \"trigger2\"\n"};
    const auto agree = [](const Configuration& configuration, std::uint32_t parts) {
        const wire::BoardHello board = board_without(parts);
        PartRefusals refusals;
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
        const Configuration configuration = load_parts(text);
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

TEST_CASE("board_parts: what an older firmware cannot do is named by its key") {
    const std::string text =
        left_section + "[clock]\nalign = true\n[ports]\ninputs = ['pps']\nnmea = true\n";
    const auto message = [&](std::uint32_t capabilities) {
        return from_place(missing_capability(load_parts(text), capabilities));
    };
    CHECK(message(wire::capability_host_grid | wire::capability_nmea).empty());
    CHECK(message(wire::capability_nmea) ==
          "5:9: 'align' of [clock] is true: the board's firmware does not support moving its grid; "
          "update it, or set align = false");
    CHECK(message(wire::capability_host_grid) ==
          "8:8: 'nmea' of [ports] is true: the board's firmware does not support NMEA; update it, "
          "or set nmea = false");
    CHECK(missing_capability(load_parts(left_section), 0).empty());
    CHECK(from_place(missing_capability(load_parts("[[time_output]]\n"), 0)) ==
          "1:1: 'name' of [[time_output]]: the board's firmware has no time outputs; update it, or "
          "remove the table");
}
