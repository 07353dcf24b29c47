// SPDX-License-Identifier: BSD-3-Clause
#include "settings/configuration.hpp"

#include "settings/keys.hpp"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <random>
#include <regex>
#include <sstream>

#include "../support/message_table.hpp"
#include "../support/temporary_directory.hpp"
#include "settings/board_configuration.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

Expected<Configuration, TomlProblems> load_text(const std::string& text) {
    const test::TemporaryDirectory directory;
    return load_configuration(directory.write("versavis.toml", text));
}

/// All messages from their places on, one a line.
std::string errors_of(const std::string& text) {
    const auto configuration = load_text(text);
    std::string all;
    for (const TomlProblem& problem : configuration ? TomlProblems{} : configuration.error()) {
        const std::string message = problem.message();
        all += (all.empty() ? "" : "\n") + message.substr(problem.place.path.size() + 1);
    }
    return all;
}

/// The errors of a file that begins with `before`.
auto errors_after(const std::string& before) {
    return [before](const std::string& text) { return errors_of(before + text); };
}

const std::string cam0_section = "[[camera]]\nname = \"cam0\"\ndevice = \"10.0.0.2\"\n";

/// The example of the manual, which has every key.
std::string manual() {
    std::ifstream file(VERSAVIS_SOURCE_DIR "/docs/user/configuration.md");
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

std::string example() {
    const std::string text = manual();
    const auto begin = text.find("```toml\n") + 8;
    return text.substr(begin, text.find("```", begin) - begin);
}

}  // namespace

TEST_CASE("configuration: the manual has each key, with its default, range and meaning") {
    const std::string text = manual();
    std::size_t at = 0;
    std::string table;
    for (const auto& key : daemon::describe_keys()) {
        if (key.table != table) at = text.find('`' + (table = key.table) + '`', at);
        const std::string row = fmt::format(
            "\n| `{}` |{} | {} | {} |\n", key.key,
            key.default_value.empty() ? "" : ' ' + key.default_value, key.range, key.meaning);
        INFO(table << row);
        at = text.find(row, at);
        REQUIRE(at != std::string::npos);
    }
    const auto rows = [&](const std::string& start) {
        std::size_t count = 0;
        for (auto next = text.find(start); next != std::string::npos; next = text.find(start, next))
            ++count, next += start.size();
        return count;
    };
    CHECK(rows("\n| `") == daemon::describe_keys().size());
}

TEST_CASE("configuration: each field that the board may refuse is of one key") {
    using Field = wire::ConfigurationField;
    for (auto field = Field::rate; field <= Field::test_output;
         field = static_cast<Field>(static_cast<int>(field) + 1)) {
        INFO(static_cast<int>(field));
        CHECK(daemon::find_key(field).has_value() == (field != Field::port_options));
    }
    CHECK(daemon::find_key(Field::imu_rate)->key == "rate_hz");
    CHECK(daemon::find_key(Field::imu_rate)->board_units == 1e3);
    CHECK(daemon::find_key(Field::glitch)->board_units == 10);
}

TEST_CASE("configuration: defaults") {
    const auto configuration = load_text(cam0_section);
    REQUIRE(configuration);
    CHECK(configuration->instance == "default");
    CHECK(configuration->board.link == "usb");
    CHECK(configuration->imus.empty());
    CHECK(configuration->cameras[0].max_exposure_us == 50000);
    CHECK(configuration->cameras[0].slots == 17);
}

TEST_CASE("configuration: defaults follow the rate, so that a fast camera needs no more keys") {
    const auto configuration = load_text(cam0_section + "rate_hz = 1000\ngap_us = 300\n");
    REQUIRE(configuration);
    const CameraConfiguration& fast = configuration->cameras[0];
    CHECK(fast.max_exposure_us == 1000);
    CHECK(fast.exposure_us == 700);
    CHECK(fast.pulse_us == 100);
    CHECK(fast.latest_arrival_ms == 500);
    CHECK(fast.slots == 6 + 8 + 120);
}

TEST_CASE("configuration: a history in seconds becomes slots, beside those that are in use") {
    const auto configuration = load_text(cam0_section + "rate_hz = 30\nhistory_s = 10.01\n" +
                                         "[[imu]]\nhistory_s = 60\n[memory]\nlock = true\n");
    REQUIRE(configuration);
    CHECK(configuration->cameras[0].slots == 6 + 8 + 4 + 301);
    CHECK(configuration->imus[0].history_s == 60);
    CHECK(configuration->memory.lock);
    CHECK_FALSE(load_text(cam0_section)->memory.lock);
}

TEST_CASE("configuration: a slave has rate, phase and longest exposure of its master") {
    const auto configuration =
        load_text("[[camera]]\nname = \"s\"\ndevice = \"s\"\noutput = 1\nmaster = \"cam0\"\n" +
                  cam0_section + "rate_hz = 200\nphase_us = 10\nmax_exposure_us = 2000\n");
    REQUIRE(configuration);
    const CameraConfiguration& slave = configuration->cameras[0];
    CHECK(slave.rate_hz == 200);
    CHECK(slave.phase_us == 10);
    CHECK(slave.max_exposure_us == 2000);
    CHECK(slave.exposure_us == 2000);
}

TEST_CASE("configuration: the output clock") {
    CHECK(load_text(cam0_section)->clock.output == clock::OutputClockKind::realtime);
    CHECK_FALSE(load_text(cam0_section)->clock.force_tai);
    const auto configuration =
        load_text(cam0_section + "[clock]\noutput = \"tai\"\nforce_tai = true\n");
    REQUIRE(configuration);
    CHECK(configuration->clock.output == clock::OutputClockKind::tai);
    CHECK(configuration->clock.force_tai);
}

TEST_CASE("configuration: what is sent to the board") {
    const auto configuration =
        load_text(cam0_section +
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

TEST_CASE("configuration: slaves, light, ports and both IMUs, as sent to the board") {
    const auto configuration = load_text(
        cam0_section +
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

TEST_CASE("configuration: the filter of an exposure line, in the board's unit") {
    const auto glitch = [](const std::string& key) {
        return board_configuration(*load_text(cam0_section + key)).cameras[0].glitch;
    };
    CHECK(glitch("") * wire::glitch_unit_ns == wire::default_glitch_ns);
    CHECK(glitch("glitch_us = 0.1\n") == 1);
    CHECK(glitch("glitch_us = 25.5\n") == 255);
    CHECK(glitch("glitch_us = 7.26\n") == 73);
    CHECK(glitch("glitch_us = 7.24\n") == 72);
}

TEST_CASE("configuration: a part on I2C, and a second data-ready line, as sent to the board") {
    const auto first = [](const std::string& table) {
        return board_configuration(*load_text("[[imu]]\n" + table)).imus[0].options;
    };
    const std::string icm = "model = \"icm42688p\"\ndata_ready = true\nbus = \"i2c\"\n";
    const unsigned i2c = wire::imu_data_ready | wire::imu_i2c;
    CHECK(first("model = \"icm42688p\"\nbus = \"spi\"\n") == 0);
    CHECK(first(icm) == i2c);
    CHECK(first(icm + "i2c_address = 0x68\n") == i2c);
    CHECK(first(icm + "i2c_address = 0x69\n") == (i2c | wire::imu_i2c_second));
    CHECK(first("model = \"bmi088\"\ndata_ready = true\naccel_ready = true\n") ==
          (wire::imu_data_ready | wire::imu_accel_ready));
}

TEST_CASE("configuration: test pulses of their own, as sent to the board") {
    const auto ports = [](const std::string& keys) {
        return board_configuration(*load_text(cam0_section + "[ports]\n" + keys)).ports;
    };
    const wire::PortConfiguration none = ports("test_rate_hz = 0\n");
    CHECK(none.test == wire::test_none);
    CHECK(none.test_rate_millihertz == 0);
    const wire::PortConfiguration leds = ports("test_rate_hz = 1000\n");
    CHECK(leds.test == wire::test_rate);
    CHECK(leds.test_rate_millihertz == 1'000'000);
    CHECK(leds.test_output == wire::test_at_test);
    CHECK(leds.pulse_ns == 100'000);
    CHECK(ports("test_rate_hz = 10000\n").pulse_ns == 25'000);  // what fits
    CHECK(ports("test_rate_hz = 10000\npulse_us = 50\n").pulse_ns == 50'000);
    for (unsigned i = 1; i < wire::camera_count; ++i)
        CHECK(ports("test_rate_hz = 0.1\ntest_output = \"trigger" + std::to_string(i) + "\"\n")
                  .test_output == wire::test_at_camera0 + i);
    const wire::PortConfiguration sync = ports("test_rate_hz = 0.1\ntest_output = \"sync\"\n");
    CHECK(sync.test_rate_millihertz == 100);
    CHECK(sync.test_output == wire::test_at_sync);
}

TEST_CASE("configuration: a GNSS receiver at the UART") {
    const auto configuration =
        load_text(cam0_section + "[ports]\ninputs = [\"pps\"]\nnmea = true\nnmea_baud = 38400\n");
    REQUIRE(configuration);
    const wire::Configuration board = board_configuration(*configuration);
    CHECK(board.ports.options == wire::port_nmea);
    CHECK(board.ports.nmea_baud == 38'400);
}

TEST_CASE("configuration: features are kept in text, in their own types") {
    const auto configuration = load_text(
        cam0_section +
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

TEST_CASE("configuration: errors name line, column, key, value, range, unit and cure") {
    const std::string see_manual = "; see man versavis.toml";
    test::check_messages(
        errors_after(cam0_section),
        {{"rate_hzz = 20\n", "4:1: unknown key 'rate_hzz'; did you mean 'rate_hz'?"},
         {"rate_hz = 2000\n",
          "4:11: 'rate_hz' must be a number from 0.1 to 1000 Hz, but is 2000" + see_manual},
         {"rate_hz = '20'\n",
          "4:11: 'rate_hz' must be a number from 0.1 to 1000 Hz, but is '20'" + see_manual},
         {"rate_hz = nan\n",
          "4:11: 'rate_hz' must be a number from 0.1 to 1000 Hz, but is nan" + see_manual},
         {"output = 4\n",
          "4:10: 'output' must be a whole number from 0 to 3, but is 4" + see_manual},
         {"packet_size = 20\n",
          "4:15: 'packet_size' must be a whole number from 576 to 16000 bytes, but is 20" +
              see_manual},
         {"trigger = 'bord'\n",
          "4:11: 'trigger' must be one of board, free, ptp, but is 'bord'; did you mean "
          "\"board\"?"},
         {"trigger = 'ptp'\ncamera_clock = false\n",
          "5:16: with trigger = \"ptp\" frames are stamped by the camera's clock; remove "
          "'camera_clock', or trigger the camera by the board"},
         {"trigger = 'ptp'\nexposure = 'pulse'\n",
          "5:12: with trigger = \"ptp\" there is no trigger pulse that sets the exposure; set "
          "exposure = \"timed\""},
         {"strobe = 1\n",
          "4:10: 'strobe' must be one of active_high, active_low, none, but is 1" + see_manual},
         {"glitch_us = 0\n",
          "4:13: 'glitch_us' must be a number from 0.1 to 25.5 us, but is 0" + see_manual},
         {"glitch_us = 26\n",
          "4:13: 'glitch_us' must be a number from 0.1 to 25.5 us, but is 26" + see_manual},
         {"glitch = 5\n", "4:1: unknown key 'glitch'; did you mean 'glitch_us'?"},
         {"chunk = true\n", "4:1: unknown key 'chunk'; did you mean 'chunks'?"},
         {"history_s = -1\n",
          "4:13: 'history_s' must be a number from 0 to 3600 s, but is -1" + see_manual},
         {"slots = 20\nhistory_s = 1\n",
          "5:13: 'slots' and 'history_s' both set the size of the ring; remove one of the two"},
         {"history = \"none\"\nhistory_s = 1\n",
          "5:13: with history = \"none\" no frames are kept for so long; remove one of the two"},
         {"slots = 10\n",
          "4:9: 'slots' must be a whole number from 14 to 1024, but is 10" + see_manual},
         {"strobe_rising_us = [36, 9]\n",
          "4:20: the delay of the other edge of the exposure line is missing; set "
          "'strobe_rising_us' and 'strobe_falling_us', each [value, sigma]"},
         {"strobe_rising_us = 36\n",
          "4:20: 'strobe_rising_us' must be a list of 2 numbers from 0 to 1000" + see_manual},
         {"[camera.features]\nrate_hz = 30\n",
          "5:11: 'rate_hz' is a key of the camera, not a feature; move it above [camera.features]"},
         {"[camera.features]\nTriggerMode = 'Off'\n",
          "5:15: 'TriggerMode' is set by the service, from 'trigger'; set 'trigger' of the camera "
          "instead"},
         {"[camera.features]\nTriggerSource = 'Line1'\n",
          "5:17: 'TriggerSource' is set by the service, from 'trigger_line'; set 'trigger_line' of "
          "the camera instead"},
         {"[camera.features]\nGain = [1]\n",
          "5:8: feature 'Gain' must be a string, a number, true or false" + see_manual},
         {"[camera.features]\nGain = nan\n",
          "5:8: feature 'Gain' must be a string, a number, true or false" + see_manual},
         {"[camera.auto_exposure]\npercentile = 101\nlargest_step = 1\n",
          "5:14: 'percentile' must be a number from 0 to 100, but is 101; see "
          "man versavis.toml\n"
          "6:16: 'largest_step' must be a number from 1.01 to 10, but is 1" +
              see_manual},
         {"[ports]\npps = 'on'\n",
          "5:1: unknown key 'pps'; it belongs to [clock]: move it there, above the next table"},
         {"rated_hz_max = 1\n",
          "4:1: unknown key 'rated_hz_max'; remove it; the keys are in man versavis.toml"},
         {"Gain = 1\n",
          "4:1: unknown key 'Gain'; features of the camera go below [camera.features]"},
         {"[camera.auto_exposure]\nGain = 1\n",
          "5:1: unknown key 'Gain'; features of the camera go below [camera.features]"},
         {"[camera.auto_exposure]\nrate_hz = 1\n",
          "5:1: unknown key 'rate_hz'; it belongs to [[camera]] or [[imu]]: move it there, above "
          "the "
          "next table"},
         {"[clock]\nlog_level = 'debug'\n",
          "5:1: unknown key 'log_level'; it belongs to the top of the file: move it there, above "
          "the first table"},
         {"[camera.features]\ndata_ready = true\n",
          "5:14: 'data_ready' belongs to [[imu]], it is no feature; move it there, above the next "
          "table"},
         {"strobe = 'active'\n",
          "4:10: 'strobe' must be one of active_high, active_low, none, but is 'active'; did you "
          "mean \"active_high\" or \"active_low\"?"},
         {"[ports]\ntest_rate_hz = 10001\n",
          "5:16: 'test_rate_hz' must be a number from 0 to 10000 Hz, but is 10001" + see_manual},
         {"[ports]\ntest_rate = 10\n",
          "5:1: unknown key 'test_rate'; did you mean 'test_rate_hz'?"},
         {"[ports]\ntest_output = 'trigger4'\n",
          "5:15: 'test_output' must be one of test, sync, trigger0, trigger1, trigger2, trigger3, "
          "but is 'trigger4'" +
              see_manual},
         {"[clock]\npps = 'on'\n",
          "5:7: 'pps' must be one of off, host, nmea, but is 'on'" + see_manual},
         {"[clock]\nmax_slew_ppm = 0\n",
          "5:16: 'max_slew_ppm' must be a number from 0.1 to 500 ppm, but is 0" + see_manual},
         {"[illumination]\ncameras = 'cam0'\n",
          "5:11: 'cameras' must be a list of strings in quotes: [\"...\", \"...\"], but is 'cam0'" +
              see_manual},
         {"[memory]\nlocked = true\n", "5:1: unknown key 'locked'; did you mean 'lock'?"},
         {"[board]\nboard_delay_ns = { inputs = [1, 2, 3] }\n",
          "5:29: 'inputs' must be a list of 4 numbers from 0 to 100000" + see_manual},
         {"[[board]]\n", "4:1: 'board' must be a table: [board], but is a list" + see_manual}});
    test::check_messages(
        errors_after("[[imu]]\n"),
        {{"model = 'adis16448'\n",
          "2:9: 'model' must be one of adis16448b, adis16448a, adis16445, adis16460, adis16470, "
          "icm42688p, bmi088, vn100, but is 'adis16448'; did you mean \"adis16448b\" or "
          "\"adis16448a\"? The part's label says ADIS16448BMLZ or ADIS16448AMLZ; only the B sends "
          "a "
          "checksum"},
         {"bus = 'usb'\n", "2:7: 'bus' must be one of spi, i2c, but is 'usb'" + see_manual},
         {"busses = 'spi'\n", "2:1: unknown key 'busses'; did you mean 'bus'?"},
         {"i2c_adress = 0x69\n", "2:1: unknown key 'i2c_adress'; did you mean 'i2c_address'?"},
         {"i2c_address = '0x68'\n",
          "2:15: 'i2c_address' must be a whole number from 0 to 255, but is '0x68'" + see_manual},
         {"accel_ready = 1\n", "2:15: 'accel_ready' must be true or false, but is 1" + see_manual},
         {"history_s = 3601\n",
          "2:13: 'history_s' must be a number from 0 to 3600 s, but is 3601" + see_manual},
         {"model = 'mpu'\n",
          "2:9: 'model' must be one of adis16448b, adis16448a, adis16445, adis16460, adis16470, "
          "icm42688p, bmi088, vn100, but is 'mpu'" +
              see_manual}});
    test::check_messages(
        errors_after(""),
        {{"camera = 3\n",
          "1:10: 'camera' must be an array of tables: [[camera]], but is 3" + see_manual}});
    // The words are the parser's, the place and the cure are ours.
    for (const auto& [text, place] :
         {std::pair("instance = \n", "1:"), {"[[camera]]\nGain = 1\nGain = 2\n", "3:"}})
        CHECK_THAT(errors_after("")(text),
                   Catch::StartsWith(place) &&
                       Catch::EndsWith("; the file must be TOML in UTF-8: https://toml.io"));
}

TEST_CASE("configuration: one that serves nothing yet is valid") {
    for (const char* text : {"", "# nothing yet\n", "[ports]\ninputs = ['pps']\n"})
        CHECK(load_text(text));
}

TEST_CASE("configuration: all errors are reported at once, in the order of the file") {
    const auto configuration = load_text("instance = \"a b\"\n" + cam0_section +
                                         "rate_hzz = 1\npulse_us = 0\n[ports]\ntest = \"x\"\n");
    REQUIRE_FALSE(configuration);
    std::vector<std::uint32_t> lines;
    for (const TomlProblem& problem : configuration.error()) lines.push_back(problem.place.line);
    CHECK(lines == std::vector<std::uint32_t>{1, 5, 6, 8});
}

TEST_CASE("configuration: windows line ends and a byte order mark change nothing") {
    std::string text = "\xEF\xBB\xBF" + cam0_section + "rate_hz = 2000\n";
    for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
        text.insert(at, "\r");
    CHECK(errors_of(text) ==
          "4:11: 'rate_hz' must be a number from 0.1 to 1000 Hz, but is 2000; see "
          "man versavis.toml");
}

TEST_CASE("configuration: every key of the manual is known, and its example loads") {
    const std::string text = manual();
    const std::string all_keys = example();
    CHECK(errors_of(all_keys).empty());
    // The example shows every key of the tables below it, and only those.
    const std::regex row("\\| `([a-z_]+)` \\|");
    std::size_t rows = 0;
    for (std::sregex_iterator it(text.begin(), text.end(), row), end; it != end; ++it, ++rows)
        CHECK_THAT(all_keys, Catch::Contains((*it)[1].str() + " = "));
    CHECK(rows > 30);
    const std::regex key("(?:^|\n)([a-z_]+) = ");
    for (std::sregex_iterator it(all_keys.begin(), all_keys.end(), key), end; it != end; ++it)
        CHECK_THAT(text, Catch::Contains("| `" + (*it)[1].str() + "` |"));
}

TEST_CASE("configuration: whatever is damaged in a file, it loads or each error names its place") {
    const std::string whole = example();
    const test::TemporaryDirectory directory;
    std::mt19937 random(1);
    const auto below = [&](std::size_t end) {
        return std::uniform_int_distribution<std::size_t>(0, end - 1)(random);
    };
    const std::string marks = "\"'[]{}=.,#\n\r\t\\0-_9e\x80\xFF";
    unsigned refused = 0;
    for (int round = 0; round < 2000; ++round) {
        std::string text = whole;
        for (std::size_t damages = 1 + below(4); damages > 0 && !text.empty(); --damages) {
            const std::size_t at = below(text.size());
            switch (below(5)) {
                case 0: text[at] = static_cast<char>(below(256)); break;
                case 1: text[at] = marks[below(marks.size())]; break;
                case 2: text.insert(at, 1 + below(20), marks[below(marks.size())]); break;
                case 3: text.erase(at, 1 + below(40)); break;
                default: text.insert(at, text.substr(below(text.size()), 1 + below(200))); break;
            }
        }
        const std::string path = directory.write("versavis.toml", text);
        const auto configuration = load_configuration(path);
        if (configuration) continue;
        ++refused;
        REQUIRE_FALSE(configuration.error().empty());
        for (const TomlProblem& problem : configuration.error()) {
            REQUIRE_THAT(problem.message(), Catch::StartsWith(path + ":"));
            REQUIRE(problem.place.line > 0);
            REQUIRE(problem.place.column > 0);
            REQUIRE_FALSE(problem.cure.empty());
        }
    }
    CHECK(refused > 1000);
}

TEST_CASE("configuration: delays of lines, of the board and of an IMU's filter") {
    const auto configuration = load_text(
        cam0_section + "output = 2\nstrobe_rising_us = [36, 9]\nstrobe_falling_us = [18.5, 4]\n" +
        "latency_us = 10\n[board]\nboard_delay_ns = { inputs = [0, 0, 60, 0], outputs = [1, 2, 30, "
        "4] }\n[[imu]]\nfilter = 2\n[[imu]]\nname = \"imu1\"\nmodel = "
        "\"vn100\"\nfilter_delay_us = 2500\n");
    REQUIRE(configuration);
    CHECK(configuration->cameras[0].strobe_falling_us == std::vector<double>{18.5, 4});
    CHECK(configuration->cameras[0].board_input_ns == 60);
    CHECK(board_configuration(*configuration).cameras[2].latency_ns == 10'030);
    CHECK(configuration->imus[0].filter_delay().delay == nanoseconds(4'878'522));
    CHECK(configuration->imus[1].filter_delay().delay == microseconds(2500));
}
