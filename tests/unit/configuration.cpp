// SPDX-License-Identifier: BSD-3-Clause
#include "configuration/configuration.hpp"
#include "configuration/board_configuration.hpp"

#include <catch2/catch.hpp>
#include <fstream>
#include <regex>
#include <sstream>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

Expected<Configuration> load(const std::string& text) {
    const test::TemporaryDirectory directory;
    return load_configuration(directory.write("versavis.toml", text));
}

std::string error_of(const std::string& text) {
    const auto configuration = load(text);
    return configuration ? "no error" : configuration.error().message();
}

const std::string camera = "[[camera]]\nname = \"cam0\"\ndevice = \"10.0.0.2\"\n";

}  // namespace

TEST_CASE("configuration: an empty file is a service without cameras") {
    const auto configuration = load("");
    REQUIRE(configuration);
    CHECK(configuration->instance == "default");
    CHECK(configuration->board.link == "usb");
    CHECK(configuration->cameras.empty());
}

TEST_CASE("configuration: the output clock") {
    CHECK(load("")->clock.output == clock::OutputClockKind::realtime);
    CHECK_FALSE(load("")->clock.force_tai);
    const auto configuration = load("[clock]\noutput = \"tai\"\nforce_tai = true\n");
    REQUIRE(configuration);
    CHECK(configuration->clock.output == clock::OutputClockKind::tai);
    CHECK(configuration->clock.force_tai);
}

TEST_CASE("configuration: what the board is told") {
    const auto configuration = load(camera +
                                    "output = 2\nrate_hz = 29.97\nstrobe = "
                                    "\"active_low\"\nlatency_us = 12.5\n[[imu]]\nrate_hz = 200\n");
    REQUIRE(configuration);
    const wire::Configuration board = board_configuration(*configuration);
    CHECK(board.cameras[0].flags == 0);
    CHECK(board.cameras[2].flags == (wire::camera_enabled | wire::camera_strobe_inverted));
    CHECK(board.cameras[2].rate_uhz == 29'970'000);
    CHECK(board.cameras[2].latency_ns == 12'500);
    CHECK(board.imus[0].kind == wire::ImuKind::adis16448b);
    CHECK(board.imus[0].rate_millihertz == 200'000);
    CHECK(board.imus[1].kind == wire::ImuKind::none);
}

TEST_CASE("configuration: slaves, light, ports and both IMUs, as the board is told") {
    const auto configuration =
        load(camera +
             "rate_hz = 50\n[[camera]]\nname = \"cam1\"\ndevice = \"x\"\noutput = 3\nmaster = "
             "\"cam0\"\n" +
             "[[imu]]\nmodel = \"icm42688p\"\nrate_hz = 8000\ndata_ready = true\nfilter = 3\n" +
             "[[imu]]\nname = \"imu1\"\nmodel = \"vn100\"\n" +
             "[illumination]\ncameras = [\"cam0\", \"cam1\"]\nlead_us = 50\nmax_on_us = "
             "8000\nduty_percent = "
             "30\n" +
             "[ports]\ninputs = [\"pps\", \"sync\"]\nfalling = [\"sync\"]\nimu_output = true\ntest "
             "= \"cam1\"\n"
             "sync_rate_hz = 1\npulse_us = 20\n[board]\nkeep_configuration = true\n");
    REQUIRE(configuration);
    const wire::Configuration board = board_configuration(*configuration);
    CHECK(board.flags == wire::configuration_store);
    CHECK(board.cameras[3].flags == (wire::camera_enabled | wire::camera_slave));
    CHECK(board.cameras[3].master == 0);
    CHECK(board.cameras[3].rate_uhz == 50'000'000);
    CHECK(board.imus[0].kind == wire::ImuKind::icm42688p);
    CHECK(board.imus[0].rate_millihertz == 8'000'000);
    CHECK(board.imus[0].options == wire::imu_data_ready);
    CHECK(board.imus[0].filter == 3);
    CHECK(board.imus[1].kind == wire::ImuKind::vn100);
    CHECK(board.illumination.cameras == 0b1001);
    CHECK(board.illumination.lead_ns == 50'000);
    CHECK(board.illumination.max_on_ns == 8'000'000);
    CHECK(board.illumination.duty_ppm == 300'000);
    CHECK(board.ports.inputs == 0b1001);
    CHECK(board.ports.falling == 0b1000);
    CHECK(board.ports.options == wire::port_imu_output);
    CHECK(board.ports.test == wire::test_camera0 + 3);
    CHECK(board.ports.sync_rate_uhz == 1'000'000);
    CHECK(board.ports.pulse_ns == 20'000);
}

TEST_CASE("configuration: a GNSS receiver at the UART") {
    const auto configuration =
        load("[ports]\ninputs = [\"pps\"]\nnmea = true\nnmea_baud = 38400\n");
    REQUIRE(configuration);
    const wire::Configuration board = board_configuration(*configuration);
    CHECK(board.ports.options == wire::port_nmea);
    CHECK(board.ports.nmea_baud == 38'400);
}

TEST_CASE("configuration: features are kept in text, in their own types") {
    const auto configuration =
        load(camera +
             "[camera.features]\nGain = 6.5\nExposureAuto = \"Off\"\nReverseX = true\nBin = 2\n");
    REQUIRE(configuration);
    const auto& features = configuration->cameras[0].features;
    const auto value = [&](const std::string& name) {
        for (const auto& feature : features)
            if (feature.first == name) return feature.second;
        return std::string("absent");
    };
    CHECK(value("Gain") == "6.5");
    CHECK(value("ExposureAuto") == "Off");
    CHECK(value("ReverseX") == "true");
    CHECK(value("Bin") == "2");
}

TEST_CASE("configuration: errors name line, column and cure") {
    CHECK_THAT(error_of("instance = \n"), Catch::Contains("versavis.toml:1:"));
    CHECK_THAT(
        error_of(camera + "rate_hzz = 20\n"),
        Catch::Contains("versavis.toml:4:1: unknown key 'rate_hzz'; did you mean 'rate_hz'?"));
    CHECK_THAT(error_of(camera + "rate_hz = 2000\n"),
               Catch::Contains("versavis.toml:4:11: 'rate_hz' must be a number from 0.1 to 1000"));
    CHECK_THAT(error_of(camera + "rate_hz = \"20\"\n"), Catch::Contains("must be a number"));
    CHECK_THAT(error_of(camera + "output = 4\n"), Catch::Contains("from 0 to 3"));
    CHECK_THAT(error_of(camera + "trigger = \"bord\"\n"),
               Catch::Contains("must be one of: board, free"));
    CHECK_THAT(error_of("[[camera]]\nname = \"cam0\"\n"), Catch::Contains("needs a 'device'"));
    CHECK_THAT(error_of(camera + camera + "output = 1\n"),
               Catch::Contains("the name 'cam0' is taken"));
    CHECK_THAT(error_of(camera + "[[camera]]\nname = \"cam1\"\ndevice = \"x\"\n"),
               Catch::Contains("uses output 0, which is taken"));
    CHECK_THAT(error_of("[[camera]]\nname = \"../x\"\ndevice = \"y\"\n"),
               Catch::Contains("is not a valid name"));
    CHECK_THAT(error_of("[[camera]]\nname = \"status\"\ndevice = \"y\"\n"),
               Catch::Contains("is taken"));
    CHECK_THAT(error_of("[[imu]]\nname = \"clock\"\n"), Catch::Contains("is taken"));
    CHECK_THAT(error_of("[[imu]]\nmodel = \"mpu\"\n"),
               Catch::Contains("must be one of: adis16448b"));
    CHECK_THAT(error_of("[[imu]]\n[[imu]]\nname = \"b\"\n"), Catch::Contains("one SPI port"));
    CHECK_THAT(error_of("[[imu]]\nrate_hz = 2000\n"), Catch::Contains("from 1 to 1000"));
    CHECK_THAT(error_of(camera + "master = \"cam9\"\n"),
               Catch::Contains("cannot have 'cam9' as its master"));
    CHECK_THAT(error_of(camera + "master = \"cam0\"\n"), Catch::Contains("as its master"));
    CHECK_THAT(error_of(camera + "master = \"cam9\"\nrate_hz = 5\n"),
               Catch::Contains("its master's rate"));
    CHECK_THAT(error_of("[illumination]\ncameras = [\"cam0\"]\n"),
               Catch::Contains("is not a camera"));
    CHECK_THAT(error_of("[illumination]\ncameras = \"cam0\"\n"),
               Catch::Contains("list of strings"));
    CHECK_THAT(error_of("[ports]\ninputs = [\"gps\"]\n"), Catch::Contains("'gps' is not an input"));
    CHECK_THAT(error_of("[ports]\ntest = \"nobody\"\n"), Catch::Contains("'test' names 'nobody'"));
    CHECK_THAT(error_of("[ports]\nsync_rate_hz = 0.01\n"), Catch::Contains("0.1 to 10"));
    CHECK_THAT(error_of("[ports]\nnmea = true\n"), Catch::Contains("add \"pps\" to 'inputs'"));
    CHECK_THAT(error_of("[[imu]]\nmodel = \"vn100\"\n[ports]\ninputs = [\"pps\"]\nnmea = true\n"),
               Catch::Contains("needs the UART"));
    CHECK_THAT(error_of("[clock]\nmax_slew_ppm = 0\n"), Catch::Contains("from 0.1 to 500"));
    CHECK_THAT(error_of("[board]\nlink = \"tty\"\n"), Catch::Contains("unix:/path"));
    CHECK_THAT(error_of("camera = 3\n"), Catch::Contains("array of tables"));
    CHECK_THAT(load_configuration("/nowhere/versavis.toml").error().message(),
               Catch::Contains("/nowhere/versavis.toml"));
}

TEST_CASE("configuration: every key of the manual is known, and its example loads") {
    std::ifstream file(VERSAVIS_SOURCE_DIR "/docs/user/configuration.md");
    REQUIRE(file);
    std::stringstream text;
    text << file.rdbuf();
    const std::string manual = text.str();
    const auto begin = manual.find("```toml\n") + 8;
    const std::string example = manual.substr(begin, manual.find("```", begin) - begin);
    CHECK(error_of(example) == "no error");
    // The example shows every key of the tables below it, and only those.
    const std::regex row("\\| `([a-z_]+)` \\|");
    std::size_t rows = 0;
    for (std::sregex_iterator it(manual.begin(), manual.end(), row), end; it != end; ++it, ++rows)
        CHECK_THAT(example, Catch::Contains((*it)[1].str() + " = "));
    CHECK(rows > 30);
    const std::regex key("(?:^|\n)([a-z_]+) = ");
    for (std::sregex_iterator it(example.begin(), example.end(), key), end; it != end; ++it)
        CHECK_THAT(manual, Catch::Contains("| `" + (*it)[1].str() + "` |"));
}

TEST_CASE("configuration: delays of lines, of the board and of an IMU's filter") {
    const auto configuration = load(
        camera + "output = 2\nstrobe_rising_us = [36, 9]\nstrobe_falling_us = [18.5, 4]\n" +
        "latency_us = 10\n[board]\nboard_delay_ns = { inputs = [0, 0, 60, 0], outputs = [1, 2, 30, "
        "4] }\n[[imu]]\nfilter = 2\n[[imu]]\nname = \"imu1\"\nmodel = "
        "\"vn100\"\nfilter_delay_us = 2500\n");
    REQUIRE(configuration);
    CHECK(configuration->cameras[0].strobe_falling_us == std::vector<double>{18.5, 4});
    CHECK(configuration->cameras[0].board_input_ns == 60);
    CHECK(board_configuration(*configuration).cameras[2].latency_ns == 10'030);
    CHECK(configuration->imus[0].filter_delay().delay == nanoseconds(3'662'109));
    CHECK(configuration->imus[1].filter_delay().delay == microseconds(2500));
    CHECK_THAT(error_of(camera + "strobe_rising_us = [36, 9]\n"),
               Catch::Contains("both edges") && Catch::Contains("strobe_falling_us"));
    CHECK_THAT(error_of(camera + "strobe_rising_us = 36\n"), Catch::Contains("2 numbers"));
    CHECK_THAT(error_of("[board]\nboard_delay_ns = { inputs = [1, 2, 3] }\n"),
               Catch::Contains("4 numbers"));
}
