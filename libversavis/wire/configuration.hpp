// SPDX-License-Identifier: BSD-3-Clause
// How the host configures the board, and what the board answers
// (docs/contracts/wire-protocol.md); freestanding C++17.
#pragma once

#include <cstddef>
#include <cstring>

#include "wire/type.hpp"

namespace versavis::wire {

enum CameraFlag : std::uint32_t {
    camera_enabled = 1U << 0U,
    camera_trigger_inverted = 1U << 1U,  ///< pulses are low
    camera_strobe_inverted = 1U << 2U,   ///< the exposure line is low while exposing
    camera_no_strobe = 1U << 3U,         ///< no exposure line is wired
    camera_slave = 1U << 4U,  ///< triggered by the exposure line of `master`, in hardware
};

struct CameraConfiguration {
    std::uint32_t flags;           ///< bits of CameraFlag
    std::uint32_t rate_uhz;        ///< grid rate, micro-hertz: 100'000 to 1'000'000'000
    std::uint32_t phase_ns;        ///< grid points are at start + phase + k / rate
    std::uint32_t pulse_ns;        ///< trigger pulse width: 1'000 to 10'000'000
    std::uint32_t latency_ns;      ///< trigger to start of exposure: up to 100'000'000
    std::uint32_t gap_ns;          ///< least time from end of exposure to the next trigger
    std::int64_t exposure_ns;      ///< expected until one has been measured or announced
    std::int64_t max_exposure_ns;  ///< the board gives up on an exposure that lasts longer
    std::uint8_t master;           ///< of a slave: the camera whose exposure line triggers it
    std::uint8_t glitch;  ///< the exposure line must keep a level this long, in 100 ns; 0: 5 us
    std::uint8_t reserved[6];
};

/// How long an exposure line must keep a level, unless the configuration says otherwise. At half,
/// strobes that bounce are seen to end at once; at twice, short exposures are not seen.
inline constexpr std::uint32_t default_glitch_ns = 5'000;
inline constexpr std::uint32_t glitch_unit_ns = 100;

enum class ImuKind : std::uint8_t {
    none = 0,
    adis16448b = 1,
    adis16448a = 2,
    adis16445 = 3,
    adis16460 = 4,
    adis16470 = 5,
    icm42688p = 6,
    bmi088 = 7,
    vn100 = 8,
};

inline constexpr std::size_t imu_count = 2;  ///< port 0: SPI or I2C; port 1: UART

enum ImuOption : std::uint8_t {
    imu_data_ready =
        1U << 0U,  ///< the part's data-ready line is wired: it paces and stamps the samples
    imu_accel_ready = 1U << 1U,  ///< and that of its accelerometer, which has a clock of its own
    imu_i2c = 1U << 2U,          ///< the part is on the I2C bus
    imu_i2c_second = 1U << 3U,   ///< at the second of its two I2C addresses
};

struct ImuConfiguration {
    ImuKind kind;
    std::uint8_t filter;   ///< strength of the part's own filter; 0: the weakest
    std::uint8_t options;  ///< bits of ImuOption
    std::uint8_t reserved;
    std::uint32_t rate_millihertz;  ///< sample rate; with data-ready, one of the part's own
};

enum IlluminationFlag : std::uint8_t { illumination_inverted = 1U << 0U };  ///< low is on

/// Light while any camera of the mask exposes.
struct IlluminationConfiguration {
    std::uint8_t cameras;  ///< bit mask; 0: no light
    std::uint8_t flags;    ///< bits of IlluminationFlag
    std::uint16_t reserved;
    std::uint32_t lead_ns;    ///< on this long before the exposure: up to 1'000'000
    std::uint32_t max_on_ns;  ///< never on for longer at a time: 10'000 to 1'000'000'000
    std::uint32_t duty_ppm;   ///< never on for a larger part of the time: 1 to 1'000'000
};

enum PulseInput : std::uint8_t { pulse_pps = 0, pulse_aux0 = 1, pulse_aux1 = 2, pulse_sync = 3 };
inline constexpr std::size_t pulse_input_count = 4;

enum PortOption : std::uint8_t {
    port_imu_output = 1U << 0U,  ///< the second SPI port serves the samples of IMU 0
    port_nmea =
        1U << 1U,  ///< a GNSS receiver is at the UART and sends NMEA sentences, instead of an IMU
};

/// What the test output shows: a grid point of a camera, where the middle of its exposure should
/// be, the ticks of an IMU, or pulses at a rate of its own.
enum TestSource : std::uint8_t { test_none = 0, test_camera0 = 1, test_imu0 = 5, test_rate = 7 };

/// Where the test pulses leave: at the test output, or at an output that nothing else uses.
enum TestOutput : std::uint8_t { test_at_test = 0, test_at_camera0 = 1, test_at_sync = 5 };

struct PortConfiguration {
    std::uint8_t inputs;   ///< bit mask of the PulseInputs in use
    std::uint8_t falling;  ///< bit mask of those whose falling edge counts
    std::uint8_t options;  ///< bits of PortOption
    std::uint8_t test;     ///< TestSource: test_camera0 + camera, test_imu0 + port, or test_rate
    std::uint32_t
        sync_rate_uhz;  ///< pulses at the sync output, micro-hertz: 0 (none), 100'000 to 10'000'000
    std::uint32_t pulse_ns;   ///< width of pulses at sync and test outputs: 1'000 to 10'000'000
    std::uint32_t nmea_baud;  ///< 1'200 to 921'600; 0: 9'600
    std::uint32_t test_rate_millihertz;  ///< of test_rate: 100 to 10'000'000
    std::uint8_t test_output;            ///< TestOutput: of test_rate
    std::uint8_t reserved[3];
};

enum ConfigurationFlag : std::uint32_t {
    configuration_store =
        1U << 0U,  ///< also in force after the next power-up, before any host says so
    configuration_cameras =
        1U << 1U,  ///< changes cameras that are stopped; grid and all others go on
};

/// The whole configuration; accepted as a whole or not at all. Without configuration_cameras only
/// while all cameras are stopped.
struct Configuration {
    static constexpr Type type = Type::configuration;
    std::uint32_t id;     ///< repeated in the answer
    std::uint32_t flags;  ///< bits of ConfigurationFlag
    CameraConfiguration cameras[camera_count];
    ImuConfiguration imus[imu_count];
    IlluminationConfiguration illumination;
    PortConfiguration ports;
};

/// Mask of the cameras in which `wanted` differs, if they may change while others run: their flags
/// stay, they are no slaves and have none, and nothing else differs. Both have IMU rates of the
/// same kind, asked for or true. 0: nothing differs, or more.
inline std::uint8_t changed_cameras(const Configuration& in_force, const Configuration& wanted) {
    std::uint8_t changed = 0;
    std::uint8_t masters = 0;
    for (unsigned i = 0; i < camera_count; ++i) {
        const CameraConfiguration& old = in_force.cameras[i];
        const CameraConfiguration& camera = wanted.cameras[i];
        const bool enabled = (old.flags & camera_enabled) != 0;
        const bool follows = enabled && (old.flags & camera_slave) != 0;
        if (follows) masters = static_cast<std::uint8_t>(masters | 1U << old.master);
        if (std::memcmp(&old, &camera, sizeof camera) == 0) continue;
        if (follows || !enabled || old.flags != camera.flags) return 0;
        changed = static_cast<std::uint8_t>(changed | 1U << i);
    }
    static_assert(offsetof(Configuration, ports) + sizeof(PortConfiguration) ==
                  sizeof(Configuration));
    const bool others = std::memcmp(&in_force.imus, &wanted.imus,
                                    sizeof wanted - offsetof(Configuration, imus)) != 0;
    return others || (changed & masters) != 0 ? std::uint8_t{0} : changed;
}

enum class ConfigurationPart : std::uint8_t { camera = 0, imu = 1, illumination = 2, ports = 3 };

enum class ConfigurationField : std::uint8_t {
    rate = 1,
    pulse = 2,
    latency = 3,
    gap = 4,
    exposure = 5,
    max_exposure = 6,
    phase = 7,
    imu_kind = 8,
    imu_rate = 9,
    master = 10,
    imu_filter = 11,
    imu_options = 12,
    cameras = 13,
    lead = 14,
    max_on = 15,
    duty = 16,
    inputs = 17,
    test = 18,
    sync_rate = 19,
    port_options = 20,
    nmea_baud = 21,
    glitch = 22,
    test_rate = 23,
    test_output = 24,
    present = 25,  ///< what this board does not have; value: bit of Present, the range is empty
};

/// One field that the board refuses; one packet for each, before the answer.
struct Refusal {
    static constexpr Type type = Type::refusal;
    std::uint32_t id;  ///< of the configuration
    ConfigurationPart part;
    std::uint8_t index;  ///< camera or IMU
    ConfigurationField field;
    std::uint8_t reserved;
    std::int64_t value;
    std::int64_t minimum;
    std::int64_t maximum;
};

enum class ConfigurationStatus : std::uint8_t { taken = 0, refused = 1, running = 2 };

struct ConfigurationAnswer {
    static constexpr Type type = Type::configuration_answer;
    std::uint32_t id;
    ConfigurationStatus status;
    std::uint8_t refused;  ///< number of refusals
    std::uint8_t reserved[2];
    std::int64_t origin_ns;  ///< where the grid began: board time of its zero, as things are
    Configuration
        taken;  ///< what is in force after this answer, with the IMU rates that the parts have
};

static_assert(sizeof(CameraConfiguration) == 48 && sizeof(ImuConfiguration) == 8);
static_assert(sizeof(IlluminationConfiguration) == 16 && sizeof(PortConfiguration) == 24);
static_assert(sizeof(Configuration) == 256 && sizeof(Refusal) == 32 &&
              sizeof(ConfigurationAnswer) == 272);

}  // namespace versavis::wire
