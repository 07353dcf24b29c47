// SPDX-License-Identifier: BSD-3-Clause
#include "settings/configuration_check.hpp"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <functional>
#include <random>

#include "../support/message_table.hpp"
#include "../support/temporary_directory.hpp"
#include "configuration_check.hpp"
#include "imu/imu_part.hpp"
#include "imu/vn100.hpp"
#include "settings/board_configuration.hpp"

using namespace versavis;
using namespace versavis::daemon;
using test::accepted;

namespace {

/// All messages from their places on, one a line.
std::string check_errors(const std::string& text) {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write("c.toml", text);
    const auto configuration = load_configuration(path);
    std::string all;
    for (const TomlProblem& problem : configuration ? TomlProblems{} : configuration.error()) {
        const std::string message = problem.message();
        CHECK_THAT(message, Catch::StartsWith(path + ":"));
        all += (all.empty() ? "" : "\n") + message.substr(path.size() + 1);
    }
    return all;
}

/// Each row is what follows `before` in the file.
void check_rows(const std::string& before, const std::vector<test::MessageRow>& rows) {
    test::check_messages([&](const std::string& text) { return check_errors(before + text); },
                         rows);
}

std::string camera_section(const std::string& name, unsigned output, const std::string& more = "") {
    return fmt::format("[[camera]]\nname = '{0}'\ndevice = 'of {0}'\noutput = {1}\n{2}", name,
                       output, more);
}
const std::string cam0 = camera_section("cam0", 0);

class CheckRefusals : public firmware::RefusalSink {
 public:
    void refuse(const wire::Refusal& refusal) override { all.push_back(refusal); }
    std::vector<wire::Refusal> all;
};

using Change = std::function<void(wire::Configuration&)>;
using Setter = std::function<void(wire::Configuration&, std::int64_t)>;

constexpr std::uint32_t fastest_here = 4'000'000;

/// What goes together of all that there is.
wire::Configuration valid() {
    wire::Configuration all{};
    wire::CameraConfiguration camera{};
    camera.flags = wire::camera_enabled;
    camera.rate_uhz = 50'000'000;
    camera.pulse_ns = 1'000;
    camera.exposure_ns = 1'000'000;
    camera.max_exposure_ns = 2'000'000;
    for (std::size_t i = 0; i < 3; ++i) all.cameras[i] = camera;
    all.imus[0] = {wire::ImuKind::icm42688p, 0, wire::imu_data_ready, 0, 1'000'000};
    all.imus[1] = {wire::ImuKind::vn100, 0, wire::imu_data_ready, 0, 200'000};
    all.illumination = {3, 0, 0, 1'000, 5'000'000, 500'000};
    all.ports.inputs = 0xF;
    all.ports.options = wire::port_imu_output;
    all.ports.test = wire::test_rate;
    all.ports.test_rate_millihertz = 1'000'000;
    all.ports.pulse_ns = 1'000;
    return all;
}

std::vector<wire::Refusal> refusals_of(const wire::Configuration& configuration,
                                       std::uint32_t present = wire::present_all) {
    CheckRefusals refusals;
    firmware::check(configuration, {present, fastest_here}, refusals);
    return refusals.all;
}

}  // namespace

TEST_CASE("configuration_check: the times of a camera fit its period, its limit and its filter") {
    const std::string hidden =
        ", but must be at least 5 us ('glitch_us'): the board ignores shorter pulses on the "
        "exposure line; lower 'glitch_us', or expose longer";
    check_rows(
        camera_section("a", 0),
        {{"rate_hz = 20\nexposure_us = 60000\n",
          "6:15: 'exposure_us' is 60000 us, but must be at most 50000 us (the period less "
          "'latency_us' and 'gap_us'); lower it, or 'rate_hz'"},
         {"exposure_us = 3000\nmax_exposure_us = 2000\n",
          "5:15: 'exposure_us' is 3000 us, but must be at most 2000 us ('max_exposure_us'); "
          "lower it, or raise 'max_exposure_us'"},
         {"rate_hz = 100\nexposure_us = 8000\nlatency_us = 50\ngap_us = 2000\n",
          "6:15: 'exposure_us' is 8000 us, but must be at most 7950 us (the period less "
          "'latency_us' and 'gap_us'); lower it, or 'rate_hz'"},
         {"rate_hz = 100\nexposure_us = 8000\ngap_us = 2000\n", accepted},
         {"trigger = 'free'\nexposure_us = 60000\n", accepted},
         {"phase_us = 50000\n",
          "5:12: 'phase_us' is 50000 us, but must be at most 49999.999 us (less than the "
          "period); lower it, or 'rate_hz'"},
         {"rate_hz = 500\nlatency_us = 2000\nstrobe = 'none'\n",
          "6:14: 'latency_us' is 2000 us, but must be at most 1999.999 us (less than the "
          "period); lower it, or 'rate_hz'"},
         {"gap_us = 50000\nstrobe = 'none'\n",
          "5:10: 'gap_us' is 50000 us, but must be at most 49999.999 us (less than the period); "
          "lower it, or 'rate_hz'"},
         {"rate_hz = 500\npulse_us = 1001\n",
          "6:12: 'pulse_us' is 1001 us, but must be at most 1000 us (half the period); lower it, "
          "or 'rate_hz'"},
         // What the filter of its line takes for a disturbance.
         {"exposure_us = 4.9\n", "5:15: 'exposure_us' is 4.9 us" + hidden},
         {"glitch_us = 20\nmax_exposure_us = 15\n",
          "6:19: 'max_exposure_us' is 15 us, but must be at least 20 us ('glitch_us'): the board "
          "ignores shorter pulses on the exposure line; lower 'glitch_us', or expose longer"},
         {"exposure = 'pulse'\npulse_us = 3\n", "6:12: 'pulse_us' is 3 us" + hidden},
         {"[camera.auto_exposure]\nmin_us = 2\n", "6:10: 'min_us' is 2 us" + hidden},
         {"[camera.auto_exposure]\nmax_us = 2\n", "6:10: 'max_us' is 2 us" + hidden},
         {"[camera.features]\nExposureTime = 4.5\n", "6:16: 'ExposureTime' is 4.5 us" + hidden},
         {"[camera.features]\nExposureTimeAbs = 4.5\n",
          "6:19: 'ExposureTimeAbs' is 4.5 us" + hidden},
         {"exposure_us = 5\n", accepted},
         {"exposure_us = 0.1\nglitch_us = 0.1\n", accepted},
         {"exposure_us = 1\nstrobe = 'none'\n", accepted},
         {"exposure_us = 1\ntrigger = 'free'\n", accepted},
         {"pulse_us = 3\n", accepted},
         {"[camera.features]\nExposureTime = 5\nGain = 1\n", accepted},
         // What the camera itself is set to.
         {"rate_hz = 100\nlatency_us = 50\n[camera.features]\nExposureTime = 9951\n",
          "8:16: 'ExposureTime' is 9951 us, but must be at most 9950 us (the period less "
          "'latency_us' and 'gap_us'); lower it, or 'rate_hz'"},
         {"rate_hz = 100\nlatency_us = 50\n[camera.features]\nExposureTime = 9950\n", accepted},
         {"max_exposure_us = 20000\n[camera.features]\nExposureTimeAbs = 20001.5\n",
          "7:19: 'ExposureTimeAbs' is 20001.5 us, but must be at most 20000 us "
          "('max_exposure_us'); lower it, or raise 'max_exposure_us'"},
         {"trigger = 'free'\n[camera.features]\nExposureTime = 50001\n",
          "7:16: 'ExposureTime' is 50001 us, but must be at most 50000 us (the period); lower it, "
          "or 'rate_hz'"},
         {"exposure = 'pulse'\n[camera.features]\nExposureTime = 60000\n", accepted},
         {"[camera.features]\nExposureTime = 'long'\n", accepted},
         // How long a frame can be waited for.
         {"latest_arrival_ms = 49351\n",
          "5:21: 'latest_arrival_ms' is 49351 ms, but must be at most 49350 ms (exposures are "
          "kept no longer at this rate); lower it, or 'rate_hz'"},
         {"latest_arrival_ms = 49350\n", accepted},
         {"rate_hz = 1000\nlatest_arrival_ms = 800\n",
          "6:21: 'latest_arrival_ms' is 800 ms, but must be at most 742 ms (exposures are kept "
          "no longer at this rate); lower it, or 'rate_hz'"},
         {"camera_clock = false\nlatest_arrival_ms = 901\n",
          "6:21: 'latest_arrival_ms' is 901 ms, but must be at most 900 ms (without "
          "'camera_clock', cameras start at one trigger per second); lower it, or set "
          "camera_clock = true"},
         // How late a packet socket may deliver.
         {"receive = 'packet'\nrate_hz = 200\n",
          "5:11: receive = \"packet\" may delay frames by 2 ms, too much for a period of 5 ms; "
          "set receive = \"auto\" or \"socket\""},
         {"receive = 'packet'\nrate_hz = 166\n", accepted},
         {"receive = 'auto'\nrate_hz = 200\n", accepted}});
}

TEST_CASE("configuration_check: a preset exists and does what the keys ask for") {
    check_rows(
        camera_section("a", 0),
        {{"preset = 'flirr'\n",
          "5:10: there is no preset 'flirr'; use one of: auto, alvium, basler-ace2, basler-dart, "
          "basler-usb, flir, flir-oryx, allied-vision-gige, basler, baumer, daheng, dalsa, "
          "hikrobot, ids, imaging-source, imperx, jai, lucid, point-grey, svs-vistek, generic"},
         {"preset = 'basler-dart'\nptp = true\n",
          "6:7: the preset 'basler-dart' does not support 'ptp'; remove the key, or set the "
          "features by name in [camera.features]"},
         {"preset = 'flir'\nptp = true\n", accepted}});
    check_rows(
        "preset_directory = '/nowhere'\n",
        {{cam0,
          "1:20: /nowhere: there are no camera presets in this directory; install them, or set "
          "'preset_directory' in the configuration"}});
}

TEST_CASE("configuration_check: no shell expands a path") {
    const std::string whole = "'~' and '$' have no meaning in a path here; write the whole path";
    check_rows("", {{"state_directory = '~/state'\n", "1:19: " + whole},
                    {"state_directory = '$HOME/state'\n", "1:19: " + whole},
                    {"preset_directory = '~versavis'\n" + cam0, "1:20: " + whole},
                    {"[board]\nlink = 'unix:~/socket'\n", "2:8: " + whole},
                    {"state_directory = '/var/a~b'\n", accepted}});
}

TEST_CASE("configuration_check: limits of auto exposure agree with each other") {
    check_rows(
        camera_section("a", 0),
        {{"[camera.auto_exposure]\nmin_us = 30000\nmax_us = 20000\n",
          "6:10: 'min_us' is 30000 us, but must be at most 20000 us ('max_us'); lower it, or "
          "raise 'max_us'"},
         {"[camera.auto_exposure]\nmin_us = 60000\n",
          "6:10: 'min_us' is 60000 us, but must be at most 50000 us ('max_us'); lower it, or "
          "raise 'max_us'"},
         {"max_exposure_us = 9000\n[camera.auto_exposure]\nmax_us = 9001\n",
          "7:10: 'max_us' is 9001 us, but must be at most 9000 us ('max_exposure_us' of the "
          "camera); lower it, or raise 'max_exposure_us'"},
         {"max_exposure_us = 20\n[camera.auto_exposure]\n", accepted},
         {"exposure = 'pulse'\n[camera.auto_exposure]\n",
          "6:1: with exposure = \"pulse\" the trigger sets the exposure, so auto exposure "
          "cannot; set exposure = \"timed\", or remove [camera.auto_exposure]"}});
}

TEST_CASE("configuration_check: names, devices and outputs are valid and not used twice") {
    check_rows(
        cam0,
        {{"[[camera]]\nname = 'cam1'\ndevice = 'OF cam0'\noutput = 1\n",
          "7:10: the device 'OF cam0' is already used by [[camera]] \"cam0\" on line 1; set "
          "another device, or remove one of the two tables"},
         {"[[camera]]\nname = 'm'\ndevice = '00-11-22-33-44-5A'\noutput = 1\n"
          "[[camera]]\nname = 'n'\ndevice = '0011.2233.445a'\noutput = 2\n",
          "11:10: the device '0011.2233.445a' is already used by [[camera]] \"m\" on line 5; set "
          "another device, or remove one of the two tables"},
         {camera_section("cam1", 0),
          "8:10: output 0 is already used by [[camera]] \"cam0\" on line 1; free outputs: 1, 2, 3"},
         {camera_section("cam1", 0, "trigger = 'free'\n"), accepted},
         {"[[camera]]\nname = 'cam1'\ndevice = 'x'\n",
          "5:1: output 0 is already used by [[camera]] \"cam0\" on line 1; free outputs: 1, 2, 3"},
         {camera_section("b", 1) + camera_section("c", 2) + camera_section("d", 3) +
              camera_section("e", 3),
          "20:10: output 3 is already used by [[camera]] \"d\" on line 13; the board triggers at "
          "most four cameras: remove one"},
         {"[[imu]]\nname = 'cam0'\n",
          "6:8: the name 'cam0' is already used by [[camera]] \"cam0\" on line 1; choose another "
          "name"},
         {"[[imu]]\nname = \"a\\u001b[31m\"\n",
          "6:8: 'a?[31m' is not a valid name; use at most 31 letters, digits, '_' and '-'"},
         // What is wrong already is not reported again in other words.
         {camera_section("cam1", 4),
          "8:10: 'output' must be a whole number from 0 to 3, but is 4; see "
          "man versavis.toml"}});
    check_rows(
        "",
        {{camera_section("clock", 0),
          "2:8: the name 'clock' is reserved for a stream of the service; choose another name"},
         {camera_section("events", 0),
          "2:8: the name 'events' is reserved for a stream of the service; choose another name"},
         {camera_section("status", 0),
          "2:8: the name 'status' is reserved for a stream of the service; choose another name"},
         {camera_section("nmea0", 0),
          "2:8: the name 'nmea0' is reserved for a stream of the service; choose another name"},
         {camera_section("cam0-evidence", 0),
          "2:8: the name 'cam0-evidence' is reserved for a stream of the service; choose another "
          "name"},
         {camera_section("../x", 0),
          "2:8: '../x' is not a valid name; use at most 31 letters, digits, '_' and '-'"},
         {"[[camera]]\ndevice = 'x'\n", "1:1: 'name' is missing; set one, such as \"cam0\""},
         {"instance = 'a/b'\n" + cam0,
          "1:12: 'a/b' is not a valid name; use at most 31 letters, digits, '_' and '-'"},
         {"camera = 1\n",
          "1:10: 'camera' must be an array of tables: [[camera]], but is 1; see "
          "man versavis.toml"}});
    const std::string no_address =
        " is not an IP address; an IP address is four numbers from 0 to 255 without leading zeros, "
        "such as 192.168.1.20";
    check_rows("[[camera]]\nname = 'a'\n",
               {{"",
                 "1:1: 'device' is missing; set the camera's IP address, serial number or name; "
                 "versavis discover lists them"},
                {"device = ''\n",
                 "3:10: 'device' is missing; set the camera's IP address, serial number or name; "
                 "versavis discover lists them"},
                {"device = '192.168.1.300'\n", "3:10: '192.168.1.300'" + no_address},
                {"device = '192.168.1'\n", "3:10: '192.168.1'" + no_address},
                {"device = '1.2.3.4.5'\n", "3:10: '1.2.3.4.5'" + no_address},
                {"device = '1..2.3'\n", "3:10: '1..2.3'" + no_address},
                {"device = '192.168.1.20'\n", accepted},
                {"device = '21098765'\n", accepted},
                {"device = 'Basler-21.5.3'\n", accepted},
                {"device = '00:11:1c:aa:bb:cc'\n", accepted}});
}

TEST_CASE("configuration_check: which cameras can be a master") {
    const auto slave = [](const std::string& more) { return camera_section("slave", 1, more); };
    check_rows(
        cam0,
        {{slave("master = 'cam9'\n"),
          "9:10: 'cam9' cannot be the master: there is no camera with that name; possible masters: "
          "cam0"},
         {slave("master = 'slave'\n"),
          "9:10: 'slave' cannot be the master: it is the slave itself; possible masters: cam0"},
         {slave("master = 'cam0'\n") + camera_section("third", 2, "master = 'slave'\n"),
          "14:10: 'slave' cannot be the master: it is a slave itself; possible masters: cam0"},
         {slave("master = 'cam0'\ntrigger = 'free'\n"),
          "9:10: a camera with trigger = \"free\" cannot have a 'master'; remove one of the two"},
         {slave("master = 'cam0'\nrate_hz = 10\n"),
          "10:11: a slave takes 'rate_hz' from its master; remove the key, or 'master'"},
         {slave("master = 'cam0'\nphase_us = 10\n"),
          "10:12: a slave takes 'phase_us' from its master; remove the key, or 'master'"},
         {slave("master = 'cam0'\nmax_exposure_us = 10\n"),
          "10:19: a slave takes 'max_exposure_us' from its master; remove the key, or 'master'"}});
    check_rows(slave("master = 'cam0'\n"),
               {{cam0, accepted},
                {camera_section("cam0", 0, "trigger = 'free'\n"),
                 "5:10: 'cam0' cannot be the master: the board does not "
                 "trigger it; no other camera can be one: remove 'master'"},
                {camera_section("cam0", 0, "strobe = 'none'\n"),
                 "5:10: 'cam0' cannot be the master: it has no exposure "
                 "line; no other camera can be one: remove 'master'"}});
}

TEST_CASE("configuration_check: rate, filter, bus and lines of an IMU are those of its part") {
    check_rows(
        "[[imu]]\n",
        {{"rate_hz = 900\ndata_ready = true\n",
          "2:11: 'rate_hz' is 900 Hz, but must be at most 819.2 Hz (the maximum of the "
          "adis16448b); lower it"},
         {"model = 'icm42688p'\nrate_hz = 2000\n",
          "3:11: 'rate_hz' is 2000 Hz, but must be at most 1000 Hz (without the data-ready line); "
          "lower it, or wire that line and set data_ready = true"},
         {"model = 'bmi088'\nfilter = 3\n",
          "3:10: 'filter' is 3, but must be at most 2 (the maximum of the bmi088); lower it"},
         {"[[imu]]\nname = 'b'\n",
          "2:1: the board has one IMU port on SPI or I2C, already used by [[imu]] on line 1; "
          "remove one of the two tables; a vn100 is on the UART, all others are on SPI or I2C"},
         {"model = 'bmi088'\nbus = 'i2c'\n",
          "3:7: the bmi088 is not supported on I2C; set bus = \"spi\"; only the icm42688p can be "
          "on I2C"},
         {"model = 'vn100'\nbus = 'spi'\n", "3:7: the vn100 is always on the UART; remove the key"},
         {"model = 'vn100'\nbus = 'i2c'\n", "3:7: the vn100 is always on the UART; remove the key"},
         {"i2c_address = 0x68\n", "2:15: 'i2c_address' is only for a part on I2C; remove the key"},
         {"model = 'icm42688p'\ndata_ready = true\naccel_ready = true\n",
          "4:15: the icm42688p has no separate data-ready line for its accelerometer; remove the "
          "key; only the bmi088 has one"},
         {"model = 'bmi088'\naccel_ready = true\n",
          "3:15: 'accel_ready' needs the data-ready line of the gyro, which paces the samples; "
          "wire that line and set data_ready = true, or remove the key"},
         {"model = 'bmi088'\ndata_ready = true\naccel_ready = true\n", accepted}});
    check_rows(
        "[[imu]]\nmodel = 'icm42688p'\n",
        {{"i2c_address = 0x69\n",
          "3:15: 'i2c_address' is only for a part on I2C; set bus = \"i2c\", or remove the key"},
         {"bus = 'i2c'\n",
          "3:7: reads over I2C are slow, so the data-ready line must start them; wire that line "
          "and set data_ready = true, or connect the part to SPI"},
         {"bus = 'i2c'\ndata_ready = true\ni2c_address = 0x6A\n",
          "5:15: 'i2c_address' is 0x6A, but must be 0x68 or 0x69; the address pin of the part "
          "selects which"},
         {"bus = 'i2c'\ndata_ready = true\nrate_hz = 1000\n", accepted},
         {"bus = 'i2c'\ndata_ready = true\nrate_hz = 1001\n",
          "5:11: 'rate_hz' is 1001 Hz, but must be at most 1000 Hz (the maximum of the icm42688p "
          "on I2C); lower it, or connect the part to SPI"},
         {"bus = 'i2c'\ndata_ready = true\nrate_hz = 8000\n",
          "5:11: 'rate_hz' is 8000 Hz, but must be at most 1000 Hz (the maximum of the icm42688p "
          "on I2C); lower it, or connect the part to SPI"},
         {"bus = 'spi'\ndata_ready = true\nrate_hz = 8000\n", accepted}});
}

TEST_CASE("configuration_check: test pulses use an output that nothing else uses") {
    check_rows(
        cam0 + camera_section("cam1", 1) + "[ports]\n",
        {{"test_rate_hz = 0.05\n",
          "10:16: 'test_rate_hz' must be 0 (no pulses), or 0.1 to 10000 Hz; raise it, or set it "
          "to 0"},
         {"test_rate_hz = 0.1\n", accepted},
         {"test_rate_hz = 10000\n", accepted},
         {"test_rate_hz = 10000\npulse_us = 50\n", accepted},
         {"test_rate_hz = 10000\npulse_us = 51\n",
          "11:12: 'pulse_us' is 51 us, but must be at most 50 us (half the period of "
          "'test_rate_hz'); lower it"},
         {"test = 'cam1'\ntest_rate_hz = 10\n",
          "11:16: the test output already shows 'cam1' ('test'); remove one of the two keys"},
         {"test_output = 'trigger3'\n",
          "10:15: 'test_output' has no effect without 'test_rate_hz'; set 'test_rate_hz', or "
          "remove the key"},
         {"test_output = 'test'\ntest_rate_hz = 0\ntest = 'cam0'\n", accepted},
         {"test_rate_hz = 10\ntest_output = 'trigger1'\n",
          "11:15: output 1 is already used by [[camera]] \"cam1\" on line 5; free outputs: test, "
          "sync, trigger2, trigger3"},
         {"test_rate_hz = 10\ntest_output = 'trigger2'\nsync_rate_hz = 1\n", accepted},
         {"test_rate_hz = 10\ntest_output = 'sync'\nsync_rate_hz = 1\n",
          "11:15: the sync output is used by 'sync_rate_hz'; set sync_rate_hz = 0, or choose "
          "another output"},
         {"test_rate_hz = 10\ntest_output = 'sync'\n", accepted}});
    check_rows(camera_section("cam1", 1, "trigger = 'free'\n"),
               {{"[ports]\ntest_rate_hz = 10\ntest_output = 'trigger1'\n", accepted}});
}

TEST_CASE("configuration_check: board, clock, light and ports use what is there") {
    check_rows(
        cam0,
        {{"[board]\nlink = 'unix:'\n",
          "6:8: 'unix:' is not a valid link; use \"usb\" or \"unix:/path/of/socket\""},
         {"[board]\nlink = 'tty'\n",
          "6:8: 'tty' is not a valid link; use \"usb\" or \"unix:/path/of/socket\""},
         {"[board]\nlink = 'unix:" + std::string(107, 'a') + "'\n", accepted},
         {"[board]\nlink = 'unix:" + std::string(108, 'a') + "'\n",
          "6:8: a socket path can have at most 107 characters; use a shorter path"},
         {"[clock]\npps = 'host'\n",
          "6:7: 'pps' needs the PPS input, which is not enabled; add \"pps\" to 'inputs' of "
          "[ports]"},
         {"[clock]\npps = 'nmea'\n[ports]\ninputs = ['pps']\n",
          "6:7: pps = \"nmea\" needs a GNSS receiver at the board's UART; set nmea = true in "
          "[ports], or pps = \"host\""},
         {"[clock]\npps = 'host'\noutput = 'monotonic_raw'\n[ports]\ninputs = ['pps']\n",
          "6:7: PPS cannot label CLOCK_MONOTONIC_RAW; set output = \"realtime\" or \"tai\", or "
          "pps = \"off\""},
         {"[illumination]\ncameras = ['cam1']\n",
          "6:11: 'cam1' is not a camera that the board triggers; use the 'name' of a [[camera]]"},
         {"[ports]\nnmea = true\n",
          "6:8: 'nmea' labels the pulses of the PPS input, which is not enabled; add \"pps\" to "
          "'inputs'"},
         {"[ports]\nfollow_sync = true\n",
          "6:15: 'follow_sync' needs the pulses of the sync input, which is not enabled; add "
          "\"sync\" to 'inputs'"},
         {"[clock]\nalign = true\n[ports]\ninputs = ['sync']\nfollow_sync = true\n",
          "9:15: the grid cannot follow sync pulses and, by 'align' of [clock], the output clock; "
          "remove one of the two keys"},
         {"[ports]\ninputs = ['gps']\n",
          "6:10: 'gps' is not an input; use any of: pps, aux0, aux1, sync"},
         {"[ports]\nfalling = ['aux0']\n",
          "6:11: the input 'aux0' is not enabled; add it to 'inputs', or remove it"},
         {"[ports]\ntest = 'nobody'\n",
          "6:8: 'nobody' is neither a triggered camera nor an IMU; use the 'name' of a "
          "[[camera]] or [[imu]], or \"\" for none"},
         {"[ports]\nimu_output = true\n",
          "6:14: 'imu_output' needs an IMU on SPI or I2C; add an [[imu]] of any model but vn100, "
          "or remove the key"},
         {"[ports]\nsync_rate_hz = 0.01\n",
          "6:16: 'sync_rate_hz' must be 0 (no pulses), or 0.1 to 10 Hz; raise it, or set it to "
          "0"}});
    check_rows(
        "[[imu]]\nmodel = 'vn100'\n[ports]\n",
        {{"inputs = ['pps']\nnmea = true\n",
          "5:8: 'nmea' needs the UART, which the vn100 uses; remove one of the two"},
         {"test = 'imu0'\n",
          "4:8: without its data-ready line, the samples of a vn100 cannot be shown; wire that "
          "line and set data_ready = true, or choose another 'test'"}});
    check_rows(
        camera_section("cam0", 0, "rate_hz = 1000\n"),
        {{"[ports]\ntest = 'cam0'\npulse_us = 501\n",
          "8:12: 'pulse_us' is 501 us, but must be at most 500 us (half the period of 'cam0', "
          "which 'test' shows); lower it"}});
}

TEST_CASE("configuration_check: what a model of IMU can do is what its part does on the board") {
    for (const std::string& name : imu::model_names()) {
        const imu::ImuModel& model = *imu::find_model(name);
        INFO(name);
        const firmware::ImuPart* part = firmware::find_part(model.kind);
        const bool serial = model.kind == wire::ImuKind::vn100;
        REQUIRE((part != nullptr || serial));
        CHECK(std::llround(model.fastest_hz * 1e3) ==
              (serial ? firmware::vn100::fastest_millihertz : part->fastest_millihertz()));
        CHECK(model.strongest_filter == (serial ? 0 : part->strongest_filter()));
        CHECK(std::llround(model.fastest_i2c_hz * 1e3) ==
              (serial ? 0 : part->fastest_i2c_millihertz()));
        CHECK(model.accel_ready == (!serial && part->accel_millihertz() != 0));
    }
}

TEST_CASE(
    "configuration_check: the board takes what is at a limit, and refuses what is beyond it") {
    using Part = wire::ConfigurationPart;
    using Field = wire::ConfigurationField;
    struct Limit {
        Part part;
        Field field;
        std::int64_t minimum, maximum;
        Setter set;
        Change before = [](wire::Configuration&) {};
    };
    const auto camera = [](auto member) {
        return [member](auto& all, auto value) {
            all.cameras[2].*member =
                static_cast<std::decay_t<decltype(all.cameras[2].*member)>>(value);
        };
    };
    const auto imu = [](std::size_t port, auto member) {
        return [=](auto& all, auto value) {
            all.imus[port].*member =
                static_cast<std::decay_t<decltype(all.imus[port].*member)>>(value);
        };
    };
    const auto light = [](auto member) {
        return [member](auto& all, auto value) {
            all.illumination.*member =
                static_cast<std::decay_t<decltype(all.illumination.*member)>>(value);
        };
    };
    const auto ports = [](auto member) {
        return [member](auto& all, auto value) {
            all.ports.*member = static_cast<std::decay_t<decltype(all.ports.*member)>>(value);
        };
    };
    using Camera = wire::CameraConfiguration;
    using Imu = wire::ImuConfiguration;
    using Light = wire::IlluminationConfiguration;
    using Ports = wire::PortConfiguration;
    const Change slow = [](auto& all) { all.cameras[2].rate_uhz = 5'000'000; };
    const Change fast = [](auto& all) { all.cameras[2].rate_uhz = 1'000'000'000; };
    const Change on_grid = [](auto& all) { all.imus[0].options = 0; };
    const Change by_i2c = [](auto& all) { all.imus[0].options |= wire::imu_i2c; };
    const Change with_sync = [](auto& all) { all.ports.sync_rate_uhz = 1'000'000; };
    const Change with_receiver = [](auto& all) {
        all.imus[1] = {};
        all.ports.options = wire::port_nmea;
    };
    const auto test_of = [](std::uint8_t source) {
        return [source](wire::Configuration& all) { all.ports.test = source; };
    };
    const Change no_test = test_of(wire::test_none);
    const Limit limits[] = {
        {Part::camera, Field::rate, 100'000, 1'000'000'000, camera(&Camera::rate_uhz)},
        {Part::camera, Field::phase, 0, 19'999'999, camera(&Camera::phase_ns)},
        {Part::camera, Field::pulse, 1'000, 10'000'000, camera(&Camera::pulse_ns)},
        {Part::camera, Field::pulse, 1'000, 10'000'000, camera(&Camera::pulse_ns), slow},
        {Part::camera, Field::pulse, 1'000, 500'000, camera(&Camera::pulse_ns), fast},
        {Part::camera, Field::latency, 0, 19'999'999, camera(&Camera::latency_ns)},
        {Part::camera, Field::latency, 0, 100'000'000, camera(&Camera::latency_ns), slow},
        {Part::camera, Field::gap, 0, 19'999'999, camera(&Camera::gap_ns)},
        {Part::camera, Field::exposure, 0, 10'000'000'000, camera(&Camera::exposure_ns)},
        {Part::camera, Field::max_exposure, 1'000, 10'000'000'000,
         camera(&Camera::max_exposure_ns)},
        {Part::imu, Field::imu_rate, 1'000, fastest_here, imu(0, &Imu::rate_millihertz)},
        {Part::imu, Field::imu_rate, 1'000, 1'000'000, imu(0, &Imu::rate_millihertz), on_grid},
        {Part::imu, Field::imu_rate, 1'000, 1'000'000, imu(0, &Imu::rate_millihertz), by_i2c},
        {Part::imu, Field::imu_rate, 1'000, 800'000, imu(1, &Imu::rate_millihertz)},
        {Part::imu, Field::imu_filter, 0, 0, imu(1, &Imu::filter)},
        {Part::imu, Field::imu_options, 0, 1, imu(1, &Imu::options)},
        {Part::imu, Field::imu_kind, 8, 8, imu(1, &Imu::kind)},
        {Part::imu, Field::imu_kind, 1, 7, imu(0, &Imu::kind), on_grid},
        {Part::illumination, Field::cameras, 1, 15, light(&Light::cameras)},
        {Part::illumination, Field::lead, 0, 1'000'000, light(&Light::lead_ns)},
        {Part::illumination, Field::max_on, 11'000, 1'000'000'000, light(&Light::max_on_ns)},
        {Part::illumination, Field::duty, 1, 1'000'000, light(&Light::duty_ppm)},
        {Part::ports, Field::inputs, 0, 15, ports(&Ports::inputs)},
        {Part::ports, Field::test_rate, 100, 10'000'000, ports(&Ports::test_rate_millihertz)},
        {Part::ports, Field::pulse, 1'000, 500'000, ports(&Ports::pulse_ns)},
        {Part::ports, Field::pulse, 1'000, 10'000'000, ports(&Ports::pulse_ns),
         test_of(wire::test_camera0 + 1)},
        {Part::ports, Field::pulse, 1'000, 500'000, ports(&Ports::pulse_ns),
         [&](auto& all) { fast(all), test_of(wire::test_camera0 + 2)(all); }},
        {Part::ports, Field::pulse, 1'000, 500'000, ports(&Ports::pulse_ns),
         test_of(wire::test_imu0)},
        {Part::ports, Field::pulse, 1'000, 2'500'000, ports(&Ports::pulse_ns),
         test_of(wire::test_imu0 + 1)},
        {Part::ports, Field::pulse, 1'000, 10'000'000, ports(&Ports::pulse_ns),
         [&](auto& all) { no_test(all), with_sync(all); }},
        {Part::ports, Field::sync_rate, 100'000, 10'000'000, ports(&Ports::sync_rate_uhz)},
        {Part::ports, Field::nmea_baud, 1'200, 921'600, ports(&Ports::nmea_baud), with_receiver},
    };
    REQUIRE(refusals_of(valid()).empty());
    for (const Limit& limit : limits) {
        INFO("part " << int(limit.part) << ", field " << int(limit.field) << ", up to "
                     << limit.maximum);
        const auto with = [&](std::int64_t value) {
            wire::Configuration all = valid();
            limit.before(all);
            limit.set(all, value);
            std::vector<wire::Refusal> refusals = refusals_of(all);
            // A period that changes takes other limits along.
            std::erase_if(refusals, [&](const auto& one) { return one.field != limit.field; });
            return refusals;
        };
        CHECK(with(limit.minimum).empty());
        CHECK(with(limit.maximum).empty());
        const auto beyond = [&](std::int64_t value) {
            const auto refusals = with(value);
            REQUIRE(refusals.size() == 1);
            CHECK(refusals[0].part == limit.part);
            CHECK(refusals[0].value == value);
            CHECK(refusals[0].minimum == limit.minimum);
            CHECK(refusals[0].maximum == limit.maximum);
        };
        // Without a kind there is no IMU, without cameras no light, and without a rate no sync.
        if (limit.minimum > 1) beyond(limit.minimum - 1);
        beyond(limit.maximum + 1);
    }
}

namespace {

void add_camera(wire::Configuration& all, std::size_t index, std::uint32_t flags = 0) {
    all.cameras[index] = valid().cameras[0];
    all.cameras[index].flags |= flags;
}
void add_slave(wire::Configuration& all, std::size_t index, std::uint8_t master) {
    add_camera(all, index, wire::camera_slave);
    all.cameras[index].master = master;
}
Change spi_imu(wire::ImuKind kind, unsigned options) {
    return [=](auto& all) {
        all.imus[0] = {kind, 0, static_cast<std::uint8_t>(options), 0, 100'000};
    };
}
Change uart_imu(unsigned options) {
    return [=](auto& all) {
        all.imus[1] = {wire::ImuKind::vn100, 0, static_cast<std::uint8_t>(options), 0, 100'000};
    };
}
Change test_of(unsigned source, unsigned output = 0, std::uint32_t millihertz = 1'000) {
    return [=](auto& all) {
        all.ports.test = static_cast<std::uint8_t>(source);
        all.ports.test_output = static_cast<std::uint8_t>(output);
        all.ports.test_rate_millihertz = millihertz;
        all.ports.pulse_ns = 1'000;
    };
}
Change operator+(const Change& first, const Change& second) {
    return [=](auto& all) { first(all), second(all); };
}

constexpr auto icm = wire::ImuKind::icm42688p;
constexpr auto bmi = wire::ImuKind::bmi088;
constexpr unsigned ready = wire::imu_data_ready;
constexpr unsigned i2c = wire::imu_i2c;
const Change sync_pulses = [](auto& all) {
    all.ports.sync_rate_uhz = 1'000'000;
    all.ports.pulse_ns = 1'000;
};
const Change nmea = [](auto& all) { all.ports.options |= wire::port_nmea; };
const Change imu_output = [](auto& all) { all.ports.options |= wire::port_imu_output; };

}  // namespace

TEST_CASE("configuration_check: the board needs what is used, and nothing else") {
    const std::pair<Change, std::uint32_t> cases[] = {
        {[](auto& /*all*/) {}, 0},
        {[](auto& all) { add_camera(all, 0); }, wire::present_camera0},
        {[](auto& all) { add_camera(all, 2); }, wire::present_camera0 << 2U},
        {spi_imu(icm, 0), wire::present_spi},
        {spi_imu(icm, ready), wire::present_spi | wire::present_ready0},
        {spi_imu(icm, ready | i2c), wire::present_i2c | wire::present_ready0},
        {spi_imu(bmi, ready | wire::imu_accel_ready),
         wire::present_spi | wire::present_ready0 | wire::present_accel_ready},
        {uart_imu(0), wire::present_uart},
        {uart_imu(ready), wire::present_uart | wire::present_ready0 << 1U},
        {[](auto& all) { all.illumination = valid().illumination; }, wire::present_light},
        {[](auto& all) { all.ports.inputs = 1; }, wire::present_pulse0},
        {[](auto& all) { all.ports.inputs = 10; }, wire::present_pulse0 * 10U},
        {test_of(wire::test_camera0 + 1), wire::present_test_output},
        {test_of(wire::test_imu0), wire::present_test_output},
        {test_of(wire::test_rate), wire::present_test_output},
        {test_of(wire::test_rate, wire::test_at_sync), wire::present_sync_output},
        {test_of(wire::test_rate, wire::test_at_camera0), wire::present_camera0},
        {test_of(wire::test_rate, wire::test_at_camera0 + 3), wire::present_camera0 << 3U},
        {sync_pulses, wire::present_sync_output},
        {spi_imu(icm, 0) + imu_output, wire::present_spi | wire::present_imu_output},
        {nmea, wire::present_uart},
        {[](auto& all) { all.flags = wire::configuration_store; }, wire::present_memory}};
    for (const auto& [change, needs] : cases) {
        INFO("needs " << needs);
        wire::Configuration all{};
        change(all);
        CHECK(refusals_of(all, needs).empty());
        for (unsigned bit = 0; bit < 19; ++bit) {
            const auto refusals = refusals_of(all, wire::present_all & ~(1U << bit));
            REQUIRE(refusals.size() == (needs >> bit & 1U));
            for (const wire::Refusal& refusal : refusals) {
                CHECK(refusal.field == wire::ConfigurationField::present);
                CHECK(refusal.value == bit);
                CHECK(refusal.minimum == 0);
                CHECK(refusal.maximum == -1);
            }
        }
    }
}

TEST_CASE("configuration_check: memory is a port, and an input that does not exist needs none") {
    wire::Configuration all{};
    all.flags = wire::configuration_store;
    const auto refusals = refusals_of(all, 0);
    REQUIRE(refusals.size() == 1);
    CHECK(refusals[0].part == wire::ConfigurationPart::ports);
    CHECK(refusals[0].index == 0);
    all = {};
    all.ports.inputs = 16;
    CHECK(refusals_of(all, 0).size() == 1);
}

TEST_CASE("configuration_check: what does not fit something else is refused, with what would") {
    using Part = wire::ConfigurationPart;
    using Field = wire::ConfigurationField;
    struct Case {
        Change change;
        Part part;
        unsigned index;
        Field field;
        std::int64_t value, minimum, maximum;
    };
    const auto slave_of = [](std::uint8_t master, std::uint32_t flags_of_2 = 0) -> Change {
        return [=](auto& all) {
            add_camera(all, 2, flags_of_2);
            add_slave(all, 3, master);
        };
    };
    const auto options = [](wire::ImuKind kind, unsigned wanted, unsigned possible) -> Case {
        return {spi_imu(kind, wanted), Part::imu, 0, Field::imu_options, wanted, 0, possible};
    };
    const auto filter = [](wire::ImuKind kind, std::uint8_t wanted, unsigned strongest) -> Case {
        return {spi_imu(kind, 0) + [=](auto& all) { all.imus[0].filter = wanted; },
                Part::imu,
                0,
                Field::imu_filter,
                wanted,
                0,
                strongest};
    };
    const auto ports = [](const Change& change, Field field, std::int64_t value,
                          std::int64_t maximum) -> Case {
        return {change, Part::ports, 0, field, value, 0, maximum};
    };
    const Case cases[] = {
        {[](auto& all) { add_camera(all, 1), all.cameras[1].rate_uhz = 0; }, Part::camera, 1,
         Field::rate, 0, 100'000, 1'000'000'000},
        // The range names a camera that could be the master, or none.
        {slave_of(0), Part::camera, 3, Field::master, 0, 2, 2},
        {slave_of(3), Part::camera, 3, Field::master, 3, 2, 2},
        {slave_of(4) + spi_imu(wire::ImuKind::adis16448b, 0), Part::camera, 3, Field::master, 4, 2,
         2},
        {slave_of(3) + [](auto& all) { add_camera(all, 0); }, Part::camera, 3, Field::master, 3, 0,
         0},
        {slave_of(2, wire::camera_no_strobe), Part::camera, 3, Field::master, 2, 0, -1},
        {slave_of(0) + [](auto& all) { add_camera(all, 1); }, Part::camera, 3, Field::master, 0, 1,
         1},
        {[](auto& all) { add_camera(all, 0), add_slave(all, 1, 0), add_slave(all, 3, 1); },
         Part::camera, 3, Field::master, 1, 0, 0},
        options(icm, ready | wire::imu_accel_ready, ready),
        options(bmi, wire::imu_accel_ready, 0),
        options(bmi, ready | i2c, ready),
        options(icm, i2c, 0),
        options(icm, ready | wire::imu_i2c_second, ready),
        options(bmi, ready | i2c | wire::imu_i2c_second, ready),
        options(icm, ready | i2c | 16U, ready | i2c),
        filter(bmi, 3, 2),
        {uart_imu(0) + [](auto& all) { all.imus[1].filter = 1; }, Part::imu, 1, Field::imu_filter,
         1, 0, 0},
        {[](auto& all) { all.illumination = {16, 0, 0, 0, 10'000, 1}; }, Part::illumination, 0,
         Field::cameras, 16, 1, 15},
        ports(test_of(8), Field::test, 8, wire::test_imu0),
        ports(test_of(wire::test_imu0 + 1) + spi_imu(icm, ready) + uart_imu(0), Field::test,
              wire::test_imu0 + 1, wire::test_imu0),
        ports(test_of(8) + uart_imu(ready), Field::test, 8, wire::test_imu0 + 1),
        ports(test_of(wire::test_rate, 6), Field::test_output, 6, 5),
        ports(test_of(wire::test_rate, wire::test_at_sync) + sync_pulses, Field::test_output, 5, 4),
        ports(
            test_of(wire::test_rate, wire::test_at_camera0 + 3) +
                [](auto& all) { add_camera(all, 3); },
            Field::test_output, 4, 0),
        {test_of(wire::test_rate, 0, 0), Part::ports, 0, Field::test_rate, 0, 100, 10'000'000},
        ports(imu_output, Field::port_options, wire::port_imu_output, 0),
        ports(uart_imu(0) + nmea, Field::port_options, wire::port_nmea, 1),
        ports(uart_imu(0) + spi_imu(icm, 0) + nmea + imu_output, Field::port_options, 3, 1)};
    for (const Case& one : cases) {
        wire::Configuration all{};
        one.change(all);
        const auto refusals = refusals_of(all);
        INFO("field " << int(one.field) << " " << one.value);
        REQUIRE(refusals.size() == 1);
        CHECK(refusals[0].part == one.part);
        CHECK(refusals[0].index == one.index);
        CHECK(refusals[0].field == one.field);
        CHECK(refusals[0].value == one.value);
        CHECK(refusals[0].minimum == one.minimum);
        CHECK(refusals[0].maximum == one.maximum);
    }
}

TEST_CASE("configuration_check: what fits is taken") {
    const Change cases[] = {
        [](auto& all) { add_camera(all, 2), add_slave(all, 0, 2), add_slave(all, 3, 2); },
        [](auto& all) { add_camera(all, 0), add_slave(all, 3, 0); },
        [](auto& all) { add_slave(all, 0, 3), add_camera(all, 3); },
        spi_imu(icm, ready | i2c | wire::imu_i2c_second),
        test_of(wire::test_imu0 + 1) + uart_imu(ready),
        test_of(wire::test_rate, wire::test_at_camera0 + 2) + sync_pulses,
        test_of(wire::test_rate, wire::test_at_sync), uart_imu(0) + spi_imu(icm, 0) + imu_output,
        nmea + sync_pulses,
        // What is not used may be anything.
        [](auto& all) { all.cameras[0].pulse_ns = all.cameras[0].gap_ns = UINT32_MAX; },
        [](auto& all) { all.imus[0].options = all.imus[1].filter = 0xFF; },
        [](auto& all) { all.illumination.lead_ns = UINT32_MAX; },
        [](auto& all) { all.ports.nmea_baud = all.ports.test_output = 77; },
        // Pulses are as wide as they like where what they show has no rate.
        test_of(wire::test_camera0) + [](auto& all) { all.ports.pulse_ns = 10'000'000; },
        test_of(wire::test_imu0) + [](auto& all) { all.ports.pulse_ns = 10'000'000; }};
    for (const Change& change : cases) {
        wire::Configuration all{};
        change(all);
        CHECK(refusals_of(all).empty());
    }
}

TEST_CASE("configuration_check: no IMU is faster than the board can read it") {
    const auto fastest = [](std::size_t port, const Change& change, std::uint32_t board) {
        wire::Configuration all{};
        change(all);
        all.imus[port].rate_millihertz = UINT32_MAX;
        CheckRefusals refusals;
        firmware::check(all, {wire::present_all, board}, refusals);
        REQUIRE(refusals.all.size() == 1);
        CHECK(refusals.all[0].field == wire::ConfigurationField::imu_rate);
        CHECK(refusals.all[0].minimum == 1'000);
        return refusals.all[0].maximum;
    };
    const auto adis = wire::ImuKind::adis16448b;
    CHECK(fastest(0, spi_imu(icm, ready), 8'000'000) == 8'000'000);
    CHECK(fastest(0, spi_imu(icm, ready), 9'000'000) == 8'000'000);
    CHECK(fastest(0, spi_imu(icm, ready), 7'999'999) == 7'999'999);
    CHECK(fastest(0, spi_imu(icm, 0), 8'000'000) == 1'000'000);
    CHECK(fastest(0, spi_imu(icm, 0), 999'999) == 999'999);
    CHECK(fastest(0, spi_imu(adis, 0), 8'000'000) == 819'200);
    CHECK(fastest(0, spi_imu(icm, ready | i2c), 8'000'000) == 1'000'000);
    CHECK(fastest(1, uart_imu(0), 8'000'000) == 800'000);
    CHECK(fastest(1, uart_imu(0), 799'999) == 799'999);
}

TEST_CASE("configuration_check: whatever is accepted, the board takes", "[statistics]") {
    const test::TemporaryDirectory directory;
    directory.write("any.toml", "");
    std::mt19937 random(7);
    const auto any = [&](std::size_t count) {
        return std::uniform_int_distribution<std::size_t>(0, count - 1)(random);
    };
    const auto real = [&](double from, double to) {
        return std::uniform_real_distribution<double>(from, to)(random);
    };
    // At and around the limits, where a rounding more or less decides.
    const auto near = [&](double limit) {
        const double parts[]{0, 1e-4, 0.25, 0.5, 0.5, 1, 1, real(0, 1.1)};
        const double shifts[]{0, 0, 0.0004, 0.0005, 0.001, -0.0004, -0.0005, -0.001};
        return limit * parts[any(8)] + shifts[any(8)];
    };
    const auto line = [&](const char* key, double value) {
        return any(8) == 0 ? fmt::format("{} = {:.17g}\n", key, value) : std::string();
    };
    const auto flag = [&](const char* text) { return any(8) == 0 ? std::string(text) : ""; };
    const auto rate = [&] {
        const double usual[]{0.1, 1, 20, 29.97, 333.333333, 999.9999, 1000};
        return any(2) == 0 ? usual[any(7)] : std::pow(10, real(-1, 3));
    };
    const auto cameras = [&] {
        std::string text;
        for (unsigned i = 0, count = static_cast<unsigned>(any(4)); i < count; ++i) {
            const double hz = rate();
            const double period = 1e6 / hz;
            text += camera_section(fmt::format("cam{}", i), i) +
                    fmt::format("rate_hz = {:.17g}\n", hz) + line("phase_us", near(period)) +
                    line("latency_us", near(period)) + line("gap_us", near(period)) +
                    line("pulse_us", near(period)) + line("exposure_us", near(period)) +
                    line("max_exposure_us", near(period)) + line("glitch_us", near(25.5)) +
                    flag("strobe = \"none\"\n");
        }
        if (any(4) == 0) text += camera_section("last", 3, "master = \"cam0\"\n");
        return text;
    };
    const auto imus = [&] {
        std::string text;
        for (const char* name : {"imu0", "imu1"})
            if (any(3) == 0)
                text += fmt::format("[[imu]]\nname = \"{}\"\nmodel = \"{}\"\n{}{}{}", name,
                                    imu::model_names()[any(8)],
                                    line("filter", static_cast<double>(any(9))),
                                    line("rate_hz", near(any(2) == 0 ? 2000 : 819.2)),
                                    flag("data_ready = true\n") + flag("accel_ready = true\n"));
        if (text.empty() && any(4) == 0)
            text = "[[imu]]\nmodel = \"icm42688p\"\nbus = \"i2c\"\ndata_ready = true\n" +
                   line("rate_hz", near(1000)) + flag("i2c_address = 0x69\n");
        return text;
    };
    const auto own_pulses = [&] {
        const char* outputs[]{"test", "sync", "trigger0", "trigger2"};
        return fmt::format("test_rate_hz = {:.17g}\ntest_output = \"{}\"\n", near(10'000),
                           outputs[any(4)]);
    };
    const auto ports = [&] {
        const char* tests[]{"cam0", "cam1", "last", "imu0", "imu1", "", "", "", "", "", ""};
        const double lead = near(1000);
        return "[illumination]\n" + flag("cameras = [\"cam0\", \"last\"]\n") +
               fmt::format("lead_us = {:.17g}\n", lead) + line("max_on_us", lead + 10 + near(0)) +
               line("duty_percent", near(100)) + "[ports]\n" + flag("inputs = [\"pps\"]\n") +
               flag("nmea = true\n") + flag("imu_output = true\n") +
               line("pulse_us", near(1e6 / rate())) + line("sync_rate_hz", near(10)) +
               (any(4) == 0 ? own_pulses() : fmt::format("test = \"{}\"\n", tests[any(11)]));
    };
    unsigned loaded = 0;
    for (int round = 0; round < 5000; ++round) {
        const std::string text = "preset_directory = \"" + directory.path().string() + "\"\n" +
                                 cameras() + imus() + ports();
        const auto configuration = load_configuration(directory.write("c", text));
        if (!configuration) continue;
        ++loaded;
        CheckRefusals refusals;
        firmware::check(board_configuration(*configuration), {wire::present_all, 8'000'000},
                        refusals);
        INFO(text);
        for (const wire::Refusal& refusal : refusals.all) FAIL(describe(*configuration, refusal));
    }
    CHECK(loaded > 500);
}
