// SPDX-License-Identifier: BSD-3-Clause
// The service's configuration: one TOML file, every key documented in docs/user/configuration.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "engine/clock/output_clock.hpp"
#include "engine/clock/pps_reference.hpp"
#include "engine/imu/imu_model.hpp"
#include "engine/pairing/evidence.hpp"
#include "engine/toml/problem.hpp"
#include "time_output_model.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"
#include "wire/limits.hpp"
#include "wire/messages.hpp"
#include "wire/usb_identity.hpp"

namespace versavis::daemon {

/// The ring of all that the pairing of a camera gets is named after the camera.
inline const std::string evidence_suffix = "-evidence";

/// Of the sentences of a GNSS receiver.
inline constexpr const char* nmea_stream = "nmea0";

// Each table knows its place in the file, for what is found out after reading, and by the board.

struct BoardConfiguration {
    TomlEntry entry;
    std::string link = "usb";  ///< "usb" or "unix:PATH"
    std::string serial;        ///< empty: any
    std::uint16_t usb_vendor = wire::usb_vendor;
    std::uint16_t usb_product = wire::usb_product;
    bool keep_configuration = false;  ///< it also holds after the board's next power-up
    std::vector<double> input_delay_ns{0, 0, 0, 0};   ///< of its exposure inputs, wire to stamp
    std::vector<double> output_delay_ns{0, 0, 0, 0};  ///< of its trigger outputs, time to wire
};

struct ClockConfiguration {
    TomlEntry entry;
    clock::OutputClockKind output = clock::OutputClockKind::realtime;
    bool force_tai = false;  ///< take CLOCK_TAI although the kernel does not know its offset
    double exchange_rate_hz = 10;
    bool align = false;        ///< the board's grid lies on whole seconds of the output clock
    double max_slew_ppm = 20;  ///< it is moved there no faster
    clock::PpsLabels pps = clock::PpsLabels::off;
    clock::SecondConflict on_second_conflict = clock::SecondConflict::flag;
};

enum class TriggerSource { board, free_run, ptp };
enum class Strobe { active_high, active_low, none };
enum class ReceiveMode { automatic, socket, packet };
enum class OnUnproved { withhold, flag };

struct AutoExposureConfiguration {
    TomlEntry entry;
    bool enabled = false;
    double target = 0.4;    ///< brightness, 0 black to 1 saturated
    double percentile = 0;  ///< of the pixels whose brightness counts; 0: the mean of all
    double min_us = 50;
    double max_us = 0;          ///< from max_exposure_us, if not given
    double largest_step = 1.5;  ///< factor from one exposure to the next
    unsigned delay_frames = 1;  ///< frames between setting an exposure and the first that has it

    bool operator==(const AutoExposureConfiguration&) const = default;
};

struct CameraConfiguration {
    TomlEntry entry;
    std::string name;
    std::string device;  ///< what Aravis finds it by: address, serial number or full name
    TriggerSource trigger = TriggerSource::board;
    unsigned output = 0;
    std::string master;  ///< name of the camera whose exposure line triggers this one; empty: none
    double rate_hz = 20;
    double phase_us = 0;
    double exposure_us = 3000;
    double max_exposure_us = 0;  ///< from the period, if not given
    double latency_us = 0;       ///< 0: that of the trigger line, as in the preset
    double gap_us = 0;
    double pulse_us = 100;
    bool trigger_inverted = false;
    Strobe strobe = Strobe::active_high;
    std::string strobe_input;  ///< of pulse_input_names, for one that is triggered by PTP
    std::string preset = "auto";
    std::string trigger_line;  ///< empty: as in the preset
    std::string strobe_line;   ///< empty: as in the preset
    /// Delay of its exposure line's edges and their sigma; empty: as in the preset.
    std::vector<double> strobe_rising_us;
    std::vector<double> strobe_falling_us;
    double glitch_us = 5;       ///< its exposure line must keep a level so long to count
    double board_input_ns = 0;  ///< of the board's exposure input for this camera
    double board_output_ns = 0;
    double grid_slew_ppm = 0;  ///< at most; 0: the grid runs freely
    bool exposure_by_pulse =
        false;  ///< the trigger's length is the exposure's: slaves with their master's exposure
    std::optional<bool> chunks;  ///< none: where the camera changes its exposure by itself
    bool keep_settings = false;  ///< the camera's own, rather than its defaults
    bool ptp = false;
    AutoExposureConfiguration auto_exposure;
    double max_temperature_c = 75;
    double link_mbps = 0;  ///< of the network link; 0: as the interface says
    unsigned slots = 17;
    double history_s = 0;  ///< frames so old can still be read: part of `slots`
    bool history = true;   ///< false: only the newest frames stay readable
    unsigned buffers = 6;
    unsigned packet_size = 0;  ///< 0: the largest that passes
    ReceiveMode receive = ReceiveMode::socket;
    double latest_arrival_ms = 500;
    OnUnproved on_unproved = OnUnproved::withhold;
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< by preset, or found out
    bool camera_clock = true;    ///< its time stamps are evidence; false: they are worthless
    bool check_exposure = true;  ///< the camera's exposure time against the measured one
    std::vector<std::pair<std::string, std::string>> features;  ///< set in this order
    TomlEntry features_entry;

    bool operator==(const CameraConfiguration&) const = default;
};

/// A time in microseconds, as the file has it.
Duration from_us(double us);

/// From one trigger of the camera to the next.
Duration period_of(const CameraConfiguration& camera);

enum class ImuBus { spi, i2c };

/// The addresses that parts on I2C can be set to by a pin.
constexpr unsigned first_i2c_address = 0x68;
constexpr unsigned second_i2c_address = 0x69;

struct ImuConfiguration {
    TomlEntry entry;
    std::string name = "imu0";
    const imu::ImuModel* model = imu::find_model(imu::model_names().front());
    ImuBus bus = ImuBus::spi;  ///< of a part on port 0
    unsigned i2c_address = first_i2c_address;
    double rate_hz = 200;
    unsigned filter = 0;
    double history_s = 0;  ///< samples so old can still be read; 0: as many as usual
    bool data_ready = false;
    bool accel_ready = false;               ///< so is the data-ready line of its accelerometer
    std::optional<double> filter_delay_us;  ///< none: as the model has it

    /// From the motion to the sample that shows it.
    imu::FilterDelay filter_delay() const;

    /// IMU port of the board: 0 SPI or I2C, 1 UART.
    std::uint8_t port() const { return model->kind == wire::ImuKind::vn100 ? 1 : 0; }
};

struct IlluminationConfiguration {
    TomlEntry entry;
    std::vector<std::string> cameras;  ///< names; empty: no light
    double lead_us = 100;
    double max_on_us = 10000;
    double duty_percent = 20;
    bool inverted = false;
};

/// Inputs whose edges become events, in the order of the board's bits.
inline const std::vector<std::string> pulse_input_names{"pps", "aux0", "aux1", "sync"};

/// Outputs that test pulses of a rate of their own can leave at.
inline const std::vector<std::pair<std::string, std::uint8_t>> test_outputs{
    {"test", wire::test_at_test},
    {"sync", wire::test_at_sync},
    {"trigger0", wire::test_at_camera0},
    {"trigger1", wire::test_at_camera0 + 1},
    {"trigger2", wire::test_at_camera0 + 2},
    {"trigger3", wire::test_at_camera0 + 3}};

constexpr double fastest_sync_hz = wire::limits::fastest_sync_uhz / 1e6;
constexpr double fastest_test_hz = wire::limits::fastest_test_millihertz / 1e3;

struct PortConfiguration {
    TomlEntry entry;
    std::vector<std::string> inputs;   ///< of pulse_input_names
    std::vector<std::string> falling;  ///< those whose falling edge counts
    bool imu_output = false;
    bool nmea = false;  ///< a GNSS receiver at the UART names the PPS pulses
    unsigned nmea_baud = 9600;
    std::string test;                               ///< name of a camera or an IMU; empty: none
    double test_rate_hz = 0;                        ///< of test pulses that show neither; 0: none
    std::uint8_t test_output = wire::test_at_test;  ///< where these leave
    double sync_rate_hz = 0;                        ///< 0: none
    bool follow_sync = false;  ///< the grid is that of the board that sends sync pulses
    double pulse_us = 100;
};

/// The sentences of a time output, in the order of the board's bits.
inline const std::vector<std::string> time_sentence_names{"RMC", "GGA", "ZDA"};

/// The time for a LiDAR: pulses at whole seconds, and sentences that name them.
struct TimeOutputConfiguration {
    TomlEntry entry;
    std::string name = "lidar";
    const TimeOutputModel* model = &time_output_models().front();
    std::uint8_t output = wire::test_at_sync;  ///< as `test_output`
    double pulse_ms = 30;
    bool pulse_inverted = false;
    double delay_us = 0;  ///< from the second to the pulse
    std::vector<std::string> sentences{"RMC"};
    std::string talker = "GP";
    unsigned baud = 9600;
    std::optional<bool> serial_inverted;  ///< none: as the model has it
    double sentence_delay_ms = 90;        ///< from the pulse to the first sentence
    unsigned holdover_s = 30;

    bool inverts_serial() const { return serial_inverted.value_or(model->serial_inverted); }
};

struct MemoryConfiguration {
    TomlEntry entry;
    bool lock = false;   ///< all of the service's memory, rings included, stays in RAM
    bool sealed = true;  ///< nobody can cut a ring short under its readers
};

struct Configuration {
    TomlEntry entry;
    std::string instance = "default";
    LogLevel log_level = LogLevel::info;
    std::string preset_directory;  ///< empty: that of the installation
    std::string state_directory;   ///< what is measured once and used later; empty: systemd's
    BoardConfiguration board;
    ClockConfiguration clock;
    std::vector<CameraConfiguration> cameras;
    std::vector<ImuConfiguration> imus;
    IlluminationConfiguration illumination;
    PortConfiguration ports;
    std::vector<TimeOutputConfiguration> time_outputs;
    MemoryConfiguration memory;
};

/// Errors: all that is wrong in the file, as far as it can be known without devices, in the order
/// of its lines; those of FILE.d follow (engine/toml/service_file.hpp).
Expected<Configuration, TomlProblems> load_configuration(const std::string& path);

/// The camera of this name, if the board triggers it; else null.
const CameraConfiguration* find_triggered_camera(const Configuration& configuration,
                                                 const std::string& name);

/// The camera that the board triggers at this output, and the IMU at this port; null: none.
const CameraConfiguration* find_camera_at(const Configuration& configuration, std::int64_t output);
const ImuConfiguration* find_imu_at(const Configuration& configuration, std::int64_t port);

/// What the test pulses show, as the board has it; none: there is nothing of the name of `test`.
std::optional<std::uint8_t> test_source(const Configuration& configuration);

/// The name of an output in `test_outputs`.
const std::string& output_name(std::uint8_t test_output);

/// Rate of the test pulses; 0: there are none.
double test_pulse_rate_hz(const Configuration& configuration);

}  // namespace versavis::daemon
