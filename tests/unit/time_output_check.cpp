// SPDX-License-Identifier: BSD-3-Clause
#include "settings/time_output_check.hpp"

#include <catch2/catch.hpp>

#include "../support/message_table.hpp"
#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;
using test::accepted;

namespace {

/// All messages from their places on, one a line.
std::string time_errors(const std::string& text) {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write("c.toml", text);
    const auto configuration = load_configuration(path);
    std::string all;
    for (const TomlProblem& problem : configuration ? TomlProblems{} : configuration.error())
        all += (all.empty() ? "" : "\n") + problem.message().substr(path.size() + 1);
    return all;
}

void check_time(const std::string& before, const std::vector<test::MessageRow>& rows) {
    test::check_messages([&](const std::string& text) { return time_errors(before + text); }, rows);
}

}  // namespace

TEST_CASE("time_output_check: the board must have what it needs") {
    check_time(
        "[[time_output]]\n",
        {{"", accepted},
         {"[ports]\nsync_rate_hz = 1\n",
          "1:1: the output 'sync' is already used by 'sync_rate_hz' of [ports]; choose "
          "another output"},
         {"output = 'test'\n[[imu]]\n[ports]\ntest = 'imu0'\n",
          "2:10: the output 'test' is already used by 'test' of [ports]; choose another "
          "output"},
         {"output = 'sync'\n[ports]\ntest_rate_hz = 10\ntest_output = 'sync'\n",
          "2:10: the output 'sync' is already used by 'test_rate_hz' of [ports]; choose "
          "another output"},
         {"output = 'trigger1'\n[[camera]]\nname = 'a'\ndevice = 'b'\noutput = 1\n",
          "2:10: the output 'trigger1' is already used by [[camera]] \"a\" on line 3; "
          "choose another output"},
         {"[[imu]]\nmodel = 'vn100'\n",
          "1:1: sentences need the UART, which the vn100 uses; set sentences = [], or remove "
          "the IMU"},
         {"sentences = []\n[[imu]]\nmodel = 'vn100'\n", accepted},
         {"[ports]\ninputs = ['pps']\nnmea = true\nnmea_baud = 38400\n",
          "1:1: the GNSS receiver on the same UART has 38400 baud ('nmea_baud'); set baud = "
          "38400, or the receiver to 9600"},
         {"[ports]\ninputs = ['pps']\nnmea = true\n", accepted},
         {"[clock]\noutput = 'monotonic_raw'\n",
          "1:1: a time output needs UTC, which CLOCK_MONOTONIC_RAW is not; set output = "
          "\"realtime\" or \"tai\" in [clock]"}});
}

TEST_CASE("time_output_check: two of them share nothing but the line") {
    const std::string first = "[[time_output]]\nname = 'a'\n";
    check_time(first,
               {{"[[time_output]]\nname = 'b'\noutput = 'test'\nsentences = []\n", accepted},
                {"[[time_output]]\nname = 'b'\nsentences = []\n",
                 "3:1: the output 'sync' is already used by [[time_output]] \"a\" on line 1; "
                 "choose another output, or connect both LiDARs to that one"},
                {"[[time_output]]\nname = 'b'\noutput = 'test'\n",
                 "3:1: the board has one serial line, already used by [[time_output]] \"a\" "
                 "on line 1; set sentences = []: both LiDARs can listen to that line"},
                {"[[time_output]]\nname = 'a'\noutput = 'test'\nsentences = []\n",
                 "4:8: the name 'a' is already used by [[time_output]] \"a\" on line 1; "
                 "choose another name"}});
    CHECK_THAT(time_errors(first + "[[time_output]]\nname = 'b'\noutput = 'test'\nsentences = []\n"
                                   "[[time_output]]\nname = 'c'\noutput = 'trigger0'\n"
                                   "sentences = []\n"),
               Catch::StartsWith("8:8: the board has 2 time outputs; connect several LiDARs to one "
                                 "of them"));
}

TEST_CASE("time_output_check: sentences are those of NMEA, and end before the next pulse") {
    check_time(
        "[[time_output]]\n",
        {{"sentences = ['RMC', 'GGA', 'ZDA']\ntalker = 'GN'\n", accepted},
         {"sentences = ['GLL']\n", "2:13: 'GLL' is not a sentence; use any of: RMC, GGA, ZDA"},
         {"talker = 'gp'\n",
          "2:10: 'gp' is not a talker; use two capital letters or digits, such as \"GP\" or "
          "\"GN\""},
         {"talker = 'GPS'\n",
          "2:10: 'GPS' is not a talker; use two capital letters or digits, such as \"GP\" "
          "or \"GN\""},
         {"sentence_delay_ms = 850\n",
          "2:21: the last sentence ends 936 ms after the pulse, but must end within 900 ms; "
          "lower it, send fewer sentences, or raise 'baud'"}});
}

TEST_CASE("time_output_check: a LiDAR gets what its manual says that it accepts") {
    check_time(
        "[[time_output]]\n",
        {{"model = 'velodyne'\npulse_ms = 10\n",
          "3:12: 'pulse_ms' is 10 ms, but must be at least 20 ms (the minimum of velodyne); "
          "raise it"},
         {"model = 'robosense'\npulse_ms = 300\n",
          "3:12: 'pulse_ms' is 300 ms, but must be at most 200 ms (the maximum of "
          "robosense); lower it"},
         {"model = 'livox'\nsentences = ['ZDA']\n", "3:13: livox does not read ZDA; use RMC"},
         {"model = 'hesai'\nsentences = ['ZDA']\n",
          "3:13: hesai does not read ZDA; use RMC or GGA"},
         {"model = 'livox'\nbaud = 115200\n",
          "3:8: livox does not read 115200 baud; use "
          "9600"},
         {"model = 'velodyne'\nsentence_delay_ms = 70\n",
          "3:21: 'sentence_delay_ms' is 70 ms, but velodyne wants the sentence 50 ms after the end "
          "of the pulse ('pulse_ms'); raise it to 80, or lower 'pulse_ms'"},
         {"model = 'livox'\nsentence_delay_ms = 440\n",
          "3:21: 'sentence_delay_ms' is 440 ms, but must be at most 430 ms (the latest begin "
          "that livox reads); lower it"},
         {"model = 'robosense'\nsentence_delay_ms = 450\n",
          "3:21: the last sentence ends 536 ms after the pulse, but must end within 500 ms; "
          "lower it, send fewer sentences, or raise 'baud'"},
         {"model = 'hesai'\npulse_ms = 100\n",
          "1:1: 'sentence_delay_ms' is 90 ms, but hesai wants the sentence 0 ms after the end of "
          "the pulse ('pulse_ms'); raise it to 100, or lower 'pulse_ms'"}});
    for (const TimeOutputModel& model : time_output_models()) {
        INFO(model.name);
        CHECK(time_errors("[[time_output]]\nmodel = '" + model.name + "'\n").empty());
    }
}
