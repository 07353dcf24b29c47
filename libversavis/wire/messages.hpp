// SPDX-License-Identifier: BSD-3-Clause
// The packets between board and host as fixed little-endian structs
// (docs/contracts/wire-protocol.md); freestanding C++17.
#pragma once

#include <type_traits>

#include "wire/configuration.hpp"
#include "wire/type.hpp"

namespace versavis::wire {

inline constexpr std::size_t max_packet_size = 512;  ///< header + payload + CRC, before COBS
inline constexpr std::size_t max_log_text = 96;

/// First bytes of every packet.
struct Header {
    Type type;
    std::uint8_t reserved[3];
    std::uint32_t nonce;     ///< board: drawn at each boot; host: drawn at each connection
    std::uint32_t sequence;  ///< counts the sender's packets since its nonce was drawn, modulo 2^32
};

struct HostHello {
    static constexpr Type type = Type::host_hello;
    std::uint8_t major;
    std::uint8_t minor;
    std::uint8_t reserved[2];
};

enum class ResetCause : std::uint8_t {
    power_on = 0,
    pin = 1,
    watchdog = 2,
    brown_out = 3,
    software = 4,
    update = 5  ///< the boot loader started the board, as it does after it was flashed
};

enum Capability : std::uint32_t {
    capability_exposure_compensation = 1U << 0U,
    capability_imu = 1U << 1U,
    capability_start_pattern = 1U << 2U,
    capability_slaves = 1U << 3U,
    capability_illumination = 1U << 4U,
    capability_pulse_inputs = 1U << 5U,
    capability_sync = 1U << 6U,
    capability_imu_output = 1U << 7U,
    capability_host_grid = 1U << 8U,  ///< the grid can be aligned by the host
    capability_nmea = 1U << 9U,  ///< NMEA sentences at the UART label the pulses of the PPS input
    capability_time_output = 1U << 10U,    ///< it sends pulses and NMEA sentences itself
    capability_sentences = 1U << 11U,      ///< it hands on what a GNSS receiver at the UART sends
    capability_camera_change = 1U << 12U,  ///< it takes configuration_cameras
    capability_grid_on_sync = 1U << 13U,   ///< the grid begins with sync pulses before any camera
};

/// What a board has pins and peripherals for.
enum Present : std::uint32_t {
    present_camera0 = 1U << 0U,  ///< trigger output and exposure input; 1 to 3 follow
    present_light = 1U << 4U,
    present_sync_output = 1U << 5U,
    present_test_output = 1U << 6U,
    present_pulse0 = 1U << 7U,  ///< + PulseInput
    present_spi = 1U << 11U,
    present_i2c = 1U << 12U,
    present_ready0 = 1U << 13U,       ///< data-ready input of IMU 0, and of IMU 1
    present_accel_ready = 1U << 15U,  ///< second data-ready input of IMU 0
    present_uart = 1U << 16U,
    present_imu_output = 1U << 17U,
    present_memory = 1U << 18U,  ///< keeps a configuration without power
    present_all = (1U << 19U) - 1U,
};

/// The first bytes of a board_hello, in every version.
struct HelloVersion {
    std::uint8_t major;
    std::uint8_t minor;
};

struct BoardHello {
    static constexpr Type type = Type::board_hello;
    std::uint8_t major;
    std::uint8_t minor;
    std::uint8_t cameras;  ///< trigger outputs that exist
    ResetCause reset_cause;
    std::uint32_t capabilities;  ///< bits of Capability
    std::int64_t board_time_ns;
    std::uint32_t present;                 ///< bits of Present
    std::uint32_t fastest_imu_millihertz;  ///< samples that the board can read
    char serial[16];                       ///< zero-padded text
    char firmware[16];                     ///< zero-padded text
};

enum ExposureFlag : std::uint16_t {
    exposure_measured = 1U << 0U,   ///< both edges were stamped
    exposure_no_start = 1U << 1U,   ///< the start edge did not come in time
    exposure_no_end = 1U << 2U,     ///< the end edge did not come in time
    exposure_late = 1U << 3U,       ///< the trigger left later than the grid asked
    exposure_pattern = 1U << 4U,    ///< part of the start pattern
    exposure_announced = 1U << 5U,  ///< trigger placed by an exposure that the host announced
    exposure_predicted =
        1U << 6U,  ///< no exposure line is wired: start and end follow from the trigger
    exposure_overlong =
        1U << 7U,  ///< longer than the maximum exposure (no end), or than the period
    exposure_clipped =
        1U << 8U,  ///< more than the maximum exposure was announced; the maximum was used
    exposure_from_master =
        1U << 9U,               ///< a slave without exposure line: start and end are the master's
    exposure_slow = 1U << 10U,  ///< part of the slow start
    exposure_uncounted =
        1U << 11U,  ///< of a slave: edges were lost, and its number may be too small since
};

/// One record for each trigger pulse that was sent, whatever the camera did.
struct Exposure {
    static constexpr Type type = Type::exposure;
    std::uint8_t camera;
    std::uint8_t reserved;
    std::uint16_t flags;  ///< bits of ExposureFlag
    std::uint32_t reserved2;
    std::uint64_t trigger;  ///< pulses sent to this camera since boot, this one included
    std::uint64_t tick;     ///< grid point of this camera since start
    std::int64_t trigger_ns;
    std::int64_t start_ns;  ///< or no_time
    std::int64_t end_ns;    ///< or no_time
};

enum ImuFlag : std::uint16_t {
    imu_check_failed =
        1U << 0U,  ///< CRC, checksum, second reading or identity of the part was wrong
    imu_self_test_failed = 1U << 1U,  ///< the sensor's own diagnosis
    imu_overrun = 1U << 2U,   ///< samples before were not read in time: their numbers are missing
    imu_stamped = 1U << 3U,   ///< the time is that of the part's data-ready edge
    imu_repeated = 1U << 4U,  ///< it holds the same data as the sample before, or the part says so
    imu_accel_stamped = 1U << 5U,  ///< the accelerometer's age is known by an edge of its own
};

/// Of an accelerometer's age, of which 16 bits hold 1 ms either way. At half, only parts faster
/// than 1 kHz fit; at twice, an age is off by up to 64 ns.
inline constexpr std::int32_t accel_age_unit_ns = 32;

/// Raw sensor words, sign-extended; the host scales them.
struct ImuSample {
    static constexpr Type type = Type::imu_sample;
    ImuKind kind;
    std::uint8_t imu;      ///< port
    std::uint16_t flags;   ///< bits of ImuFlag
    std::uint32_t number;  ///< samples that were due since boot, modulo 2^32
    std::int64_t time_ns;
    std::int32_t gyro[3];
    std::int32_t accel[3];
    std::int16_t magnetic[3];
    std::int16_t temperature;
    std::uint16_t pressure;
    std::int16_t accel_age;  ///< with imu_accel_stamped: accelerometer before time_ns, in 32 ns
    std::uint32_t
        departure_ns;  ///< from time_ns to when this packet began to leave the board; 0: unknown
};

enum class BoardEventKind : std::uint8_t {
    trigger_skipped = 1,  ///< detail: SkipReason; value: the grid tick that got no pulse
    stray_edge = 2,       ///< an exposure edge that belongs to no trigger; value: level
    output_late = 3,      ///< an output edge left too late; source: output; value: ns late
    edge_overflow = 4,    ///< edges came faster than they were read; value: edges lost
    pps = 5,              ///< value: pulses of this input since boot
    aux_pulse = 6,        ///< source: 0 or 1; value: pulses of this input since boot
    sync_pulse = 7,       ///< value: pulses of this input since boot
    input_noisy = 8,      ///< an input is ignored for a second; source: input of the board
    illumination_limited =
        9,            ///< the light would have been on for too long; value: ns that it stays dark
    imu_ready = 10,   ///< the part answers and is set up; value: its identity
    imu_failed = 11,  ///< the part is not the one configured; detail: step; value: what it answered
    imu_silent = 12,  ///< no data-ready edge, end of transfer or bytes arrived
    utc_label =
        13,  ///< a sentence labelled the PPS pulse at this time; value: UTC seconds since 1970
    triggers_skipped =
        14,           ///< grid points in a row that were too late; value: first; detail: count
    sync_lost = 15,   ///< pulses of the sync input do not fit the grid; value: ns off it
    sync_taken = 16,  ///< the grid follows the sync pulses (again); value: ns that it moves
    stored = 17,      ///< the configuration to store; value: 1 when it is safe, 0 when that failed
    time_pulse = 18,  ///< a time output sent the pulse of this second; source: its index; value:
                      ///< UTC seconds since 1970
};

enum class SkipReason : std::uint16_t {
    busy = 0,  ///< the camera was, or would have been, exposing
    late = 1,  ///< the instant had passed
    full = 2,  ///< too many pulses are waiting already
};

struct Event {
    static constexpr Type type = Type::event;
    BoardEventKind kind;
    std::uint8_t source;     ///< camera, IMU or input number
    std::uint16_t detail;    ///< see BoardEventKind
    std::uint32_t sequence;  ///< events since boot
    std::int64_t time_ns;
    std::int64_t value;
};

/// The end of the line aside; by the standard 80, which not every receiver keeps.
inline constexpr std::size_t max_sentence_text = 104;

/// One line of the GNSS receiver at the UART, right or damaged.
struct Sentence {
    static constexpr Type type = Type::sentence;
    std::int64_t time_ns;    ///< its first bit arrived
    std::uint32_t sequence;  ///< lines since boot, this one included
    std::uint8_t size;
    std::uint8_t reserved[3];
    char text[max_sentence_text];  ///< printable ASCII from '$' or '!' on, zero-padded
};

struct ClockRequest {
    static constexpr Type type = Type::clock_request;
    std::uint32_t id;
    std::uint32_t reserved;
};

struct ClockAnswer {
    static constexpr Type type = Type::clock_answer;
    std::uint32_t id;
    std::uint32_t reserved;
    std::int64_t received_ns;  ///< the request, stamped where it entered the board
    std::int64_t sent_ns;      ///< this answer, stamped as it was handed to the link
};

/// Follows the answer, from boards whose link knows when it really left.
struct ClockFollowUp {
    static constexpr Type type = Type::clock_follow_up;
    std::uint32_t id;  ///< of the request
    std::uint32_t reserved;
    std::int64_t sent_ns;  ///< the last byte of the answer left
};

enum class PpsState : std::uint8_t { none = 0, acquiring = 1, good = 2 };

/// Of the grid and the pulses of the sync input.
enum class SyncState : std::uint8_t { none = 0, lost = 1, followed = 2 };

/// Of what a board can do to prove its stamps while it runs: an edge of its own comes back stamped
/// with the time at which it left.
enum class StampTest : std::uint8_t { none = 0, failed = 1, passed = 2 };

/// Once a second; counters since boot, high-water marks since the previous report.
struct Health {
    static constexpr Type type = Type::health;
    std::int64_t board_time_ns;
    std::uint32_t
        dropped_exposures;  ///< records that were replaced by newer ones: the host did not read
    std::uint32_t dropped_clock_answers;
    std::uint32_t dropped_events;
    std::uint32_t dropped_imu_samples;
    std::uint32_t dropped_logs;
    std::uint32_t receive_errors;         ///< packets from the host that were malformed
    std::uint32_t imu_errors[imu_count];  ///< samples with a failed check
    std::uint32_t imu_restarts;           ///< how often an IMU had to be set up again
    std::uint32_t late_outputs;
    std::uint32_t lost_edges;
    std::uint32_t stray_edges;
    std::uint32_t skipped_triggers;
    std::uint32_t noisy_inputs;      ///< times that an input was ignored for a second
    std::uint32_t output_queue_max;  ///< edges that waited
    std::uint32_t link_queue_max;    ///< packets that waited
    std::uint32_t loop_max_ns;       ///< longest delay between something being due and being done
    std::int32_t pps_error_ppb;  ///< while PPS is good: board clock against it, positive runs fast
    PpsState pps_state;
    ResetCause reset_cause;
    std::uint16_t ignored;   ///< messages of the host that were out of range, modulo 2^16
    std::uint32_t glitches;  ///< edges that the filters of the inputs left out
    SyncState sync_state;
    StampTest stamp_test;
    std::uint8_t reserved[6];
};

enum class LogLevel : std::uint8_t { error = 3, warning = 4, info = 6, debug = 7 };

struct Log {
    static constexpr Type type = Type::log;
    LogLevel level;
    char text[max_log_text - 1];  ///< zero-padded
};

enum StartFlag : std::uint8_t {
    start_pattern = 1U << 0U,  ///< begin with the pattern of irregular gaps
    start_slow = 1U << 1U,     ///< one pulse a second at most, until started again without it
    start_on_sync =
        1U << 2U,  ///< begin the grid at the next pulse of the sync input, and follow them
};

/// Starts the cameras of the mask; one that is already running begins its pattern anew.
struct Start {
    static constexpr Type type = Type::start;
    std::uint8_t cameras;  ///< bit mask
    std::uint8_t flags;    ///< bits of StartFlag
    std::uint8_t reserved[2];
};

struct Stop {
    static constexpr Type type = Type::stop;
    std::uint8_t cameras;  ///< bit mask
    std::uint8_t reserved[3];
};

struct ExpectedExposure {
    static constexpr Type type = Type::expected_exposure;
    std::uint8_t camera;
    std::uint8_t reserved[7];
    std::uint64_t trigger;  ///< holds from this trigger on
    std::int64_t exposure_ns;
};

struct Reboot {
    static constexpr Type type = Type::reboot;
    std::uint32_t magic;  ///< 0x544F4F42
    std::uint32_t to_boot_loader;
};
inline constexpr std::uint32_t reboot_magic = 0x544F4F42U;

/// The nearest whole second of the grid belongs at `board_ns`; from there on the grid runs at this
/// pace.
struct AlignGrid {
    static constexpr Type type = Type::align_grid;
    std::int64_t board_ns;  ///< at most 100 s from now
    std::int32_t pace_ppb;  ///< how much faster board time passes than grid time: up to 500 ppm
    std::uint32_t
        max_slew_ppb;  ///< the grid gets there at no more than this beyond its pace: 1 to 10^6
};
inline constexpr std::int64_t align_reach_ns = 100'000'000'000;
inline constexpr std::int32_t align_largest_pace_ppb = 500'000;
inline constexpr std::uint32_t align_largest_slew_ppb = 1'000'000;

inline constexpr std::size_t time_output_count = 2;

enum TimeOutputFlag : std::uint8_t {
    time_known = 1U << 0U,            ///< else it is not known what time it is: sentences say so
    time_pulse_inverted = 1U << 1U,   ///< pulses are low
    time_serial_inverted = 1U << 2U,  ///< the line is high for a 0 and at rest low, as RS-232 is
};

/// The sentences that follow a pulse, in this order.
enum TimeSentence : std::uint8_t {
    sentence_rmc = 1U << 0U,
    sentence_gga = 1U << 1U,
    sentence_zda = 1U << 2U,
};
inline constexpr unsigned time_sentence_count = 3;

/// Where the second `utc_s` begins, and what to make of it: a pulse at each whole second, and NMEA
/// sentences that say which one it was. The host repeats it each second.
struct TimeOutput {
    static constexpr Type type = Type::time_output;
    std::int64_t board_ns;            ///< at most 10 s from now
    std::int64_t utc_s;               ///< seconds of UTC since 1970, without leap seconds
    std::int32_t pace_ppb;            ///< how much faster board time passes than UTC
    std::int32_t delay_ns;            ///< from the second to the pulse
    std::uint32_t pulse_ns;           ///< width; 0: this time output is not used
    std::uint32_t baud;               ///< of the sentences; 0: only pulses
    std::uint16_t holdover_s;         ///< without another message the board goes on for so long
    std::uint16_t sentence_delay_ms;  ///< from the pulse to the first sentence
    std::uint8_t index;               ///< which of the board's time outputs
    std::uint8_t output;              ///< where the pulses leave, as TestOutput
    std::uint8_t flags;               ///< bits of TimeOutputFlag
    std::uint8_t sentences;           ///< bits of TimeSentence
    char talker[2];                   ///< as in "GP" of "$GPRMC"
    std::uint8_t reserved[6];
};

/// The start patterns, by camera: grid points 0..19 after start that get a pulse, bit 0 first;
/// afterwards all do. Four neighbouring gaps that are not all equal occur only once in all of the
/// patterns, so that five frames identify their triggers, and show when the cables of two cameras
/// are swapped. Two of the first four gaps are longer than the shortest, so that the first five
/// frames do. A slave has its master's.
inline constexpr std::uint32_t start_pattern_bits[camera_count] = {0xE4A9B, 0xA3A75, 0xC5A5D,
                                                                   0x856D7};
inline constexpr unsigned start_pattern_length = 20;

/// Slow start: only every n-th grid point gets a pulse. Each camera has an interval of its own, at
/// least 1 s.
constexpr std::uint64_t slow_start_ticks(std::uint64_t rate_uhz, unsigned camera) {
    return (rate_uhz * (4 + camera) + 3'999'999) / 4'000'000;
}

static_assert(sizeof(Header) == 12 && sizeof(HostHello) == 4 && sizeof(BoardHello) == 56);
static_assert(sizeof(Exposure) == 48 && sizeof(ImuSample) == 56 && sizeof(Event) == 24);
static_assert(sizeof(Sentence) == 120);
static_assert(sizeof(ClockRequest) == 8 && sizeof(ClockAnswer) == 24 &&
              sizeof(ClockFollowUp) == 16 && sizeof(Health) == 96 && sizeof(Log) == 96);
static_assert(sizeof(Start) == 4 && sizeof(Stop) == 4 && sizeof(ExpectedExposure) == 24 &&
              sizeof(Reboot) == 8 && sizeof(AlignGrid) == 16 && sizeof(TimeOutput) == 48);

struct PayloadSize {
    Type type;
    std::uint16_t bytes;
};
inline constexpr PayloadSize payload_sizes[] = {
    {BoardHello::type, sizeof(BoardHello)},
    {Exposure::type, sizeof(Exposure)},
    {ImuSample::type, sizeof(ImuSample)},
    {Event::type, sizeof(Event)},
    {ClockAnswer::type, sizeof(ClockAnswer)},
    {ClockFollowUp::type, sizeof(ClockFollowUp)},
    {Health::type, sizeof(Health)},
    {Log::type, sizeof(Log)},
    {Sentence::type, sizeof(Sentence)},
    {ConfigurationAnswer::type, sizeof(ConfigurationAnswer)},
    {Refusal::type, sizeof(Refusal)},
    {HostHello::type, sizeof(HostHello)},
    {Configuration::type, sizeof(Configuration)},
    {Start::type, sizeof(Start)},
    {Stop::type, sizeof(Stop)},
    {ClockRequest::type, sizeof(ClockRequest)},
    {ExpectedExposure::type, sizeof(ExpectedExposure)},
    {Reboot::type, sizeof(Reboot)},
    {AlignGrid::type, sizeof(AlignGrid)},
    {TimeOutput::type, sizeof(TimeOutput)},
};

/// Size of the payload of `type`, or 0 when the type is unknown.
constexpr std::uint16_t payload_size(Type type) {
    for (const PayloadSize& size : payload_sizes)
        if (size.type == type) return size.bytes;
    return 0;
}

}  // namespace versavis::wire
