// SPDX-License-Identifier: BSD-3-Clause
#include "settings/board_configuration.hpp"

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

using wire::ConfigurationField;
using Part = wire::ConfigurationPart;

wire::Refusal board_refusal(Part part, unsigned index, ConfigurationField field, std::int64_t value,
                            std::int64_t minimum, std::int64_t maximum) {
    wire::Refusal made{};
    made.part = part;
    made.index = static_cast<std::uint8_t>(index);
    made.field = field;
    made.value = value;
    made.minimum = minimum;
    made.maximum = maximum;
    return made;
}

/// What is said of a refusal, for a file with all tables.
std::string description(const wire::Refusal& refused) {
    static const test::TemporaryDirectory directory;
    const auto configuration = load_configuration(directory.write(
        "versavis.toml",
        "[[camera]]\nname = \"left\"\ndevice = \"a\"\noutput = 2\npulse_us = 70\n"
        "[[camera]]\nname = \"right\"\ndevice = \"b\"\noutput = 3\nmaster = \"left\"\n"
        "[[imu]]\nname = \"inertial\"\nmodel = \"bmi088\"\nrate_hz = 400\n"
        "[illumination]\ncameras = [\"left\"]\nduty_percent = 50\n"
        "[ports]\ntest = \"left\"\nsync_rate_hz = 10\n"));
    return describe(*configuration, refused).substr(directory.path().string().size() + 1);
}

}  // namespace

TEST_CASE("board_configuration: a refusal names place, key, table, value and range of the file") {
    CHECK(description(
              board_refusal(Part::camera, 2, ConfigurationField::pulse, 70'000, 1'000, 60'500)) ==
          "versavis.toml:5:12: 'pulse_us' of [[camera]] \"left\" is 70 us: the board accepts 1 to "
          "60.5 us");
    CHECK(
        description(
            board_refusal(Part::imu, 0, ConfigurationField::imu_rate, 400'000, 1'000, 200'000)) ==
        "versavis.toml:14:11: 'rate_hz' of [[imu]] \"inertial\" is 400 Hz: the board accepts 1 to "
        "200 Hz");
    CHECK(description(board_refusal(Part::camera, 3, ConfigurationField::rate, 29'970'000, 100'000,
                                    10'000'000)) ==
          "versavis.toml:6:1: 'rate_hz' of [[camera]] \"right\" is 29.97 Hz: the board accepts 0.1 "
          "to 10 Hz");
    CHECK(description(board_refusal(Part::illumination, 0, ConfigurationField::duty, 500'000, 1,
                                    200'000)) ==
          "versavis.toml:17:16: 'duty_percent' of [illumination] is 50 %: the board accepts 0.0001 "
          "to 20 %");
    CHECK(description(board_refusal(Part::ports, 0, ConfigurationField::sync_rate, 10'000'000,
                                    100'000, 1'000'000)) ==
          "versavis.toml:20:16: 'sync_rate_hz' of [ports] is 10 Hz: the board accepts 0.1 to 1 Hz");
}

TEST_CASE("board_configuration: a refused name is reported by name, and what would do") {
    CHECK(description(board_refusal(Part::camera, 3, ConfigurationField::master, 2, 0, -1)) ==
          "versavis.toml:10:10: 'master' of [[camera]] \"right\" is \"left\": the board accepts no "
          "value");
    CHECK(description(board_refusal(Part::imu, 0, ConfigurationField::imu_kind,
                                    static_cast<std::int64_t>(wire::ImuKind::bmi088), 1, 2)) ==
          "versavis.toml:13:9: 'model' of [[imu]] \"inertial\" is \"bmi088\": the board accepts "
          "adis16448b, adis16448a");
    CHECK(description(board_refusal(Part::ports, 0, ConfigurationField::test,
                                    wire::test_camera0 + 2, wire::test_imu0, wire::test_imu0)) ==
          "versavis.toml:19:8: 'test' of [ports] is \"left\": the board accepts inertial");
}

TEST_CASE("board_configuration: refused options of an IMU are reported by their keys") {
    const auto options = [](unsigned value, unsigned possible) {
        return description(
            board_refusal(Part::imu, 0, ConfigurationField::imu_options, value, 0, possible));
    };
    const std::string why = ": the board does not support that for this IMU";
    CHECK(options(wire::imu_data_ready | wire::imu_accel_ready, wire::imu_data_ready) ==
          "versavis.toml:11:1: 'accel_ready' of [[imu]] \"inertial\" is true" + why);
    CHECK_THAT(options(wire::imu_i2c | wire::imu_data_ready, wire::imu_data_ready),
               Catch::Contains("'bus' of [[imu]] \"inertial\" is \"i2c\"" + why));
    CHECK_THAT(options(wire::imu_i2c_second, 0), Catch::Contains("'i2c_address'"));
    CHECK_THAT(options(wire::imu_data_ready, 0), Catch::Contains("'data_ready'"));
}

TEST_CASE("board_configuration: each field that a board can refuse has a key, in any file") {
    const auto key_of = [](int field) {
        return describe(
            {}, board_refusal(Part::camera, 0, static_cast<ConfigurationField>(field), 70, 10, 60));
    };
    for (int field = 1; field <= 25; ++field)
        CHECK_THAT(key_of(field), !Catch::Contains("unknown key"));
    CHECK_THAT(key_of(250), Catch::Contains("unknown key"));
}
