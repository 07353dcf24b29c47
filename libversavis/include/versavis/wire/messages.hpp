// SPDX-License-Identifier: BSD-3-Clause
// The packets between board and host as fixed little-endian structs (docs/wire-protocol.md); freestanding
// C++17.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire structs are copied as they lie in memory");

namespace versavis::wire {

inline constexpr std::uint8_t protocol_major = 1;
inline constexpr std::uint8_t protocol_minor = 0;
inline constexpr std::size_t camera_count = 4;
inline constexpr std::size_t max_packet_size = 512;  ///< header + payload + CRC, before COBS
inline constexpr std::size_t max_log_text = 96;

/// Time fields of value `no_time` say that the instant was not observed.
inline constexpr std::int64_t no_time = INT64_MIN;

enum class Type : std::uint8_t {
    board_hello = 0x01,
    exposure = 0x02,
    imu_sample = 0x03,
    event = 0x04,
    clock_answer = 0x05,
    health = 0x06,
    log = 0x07,
    configuration_answer = 0x08,
    host_hello = 0x81,
    configuration = 0x82,
    start = 0x83,
    stop = 0x84,
    clock_request = 0x85,
    expected_exposure = 0x86,
    reboot = 0x87,
};

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

enum class ResetCause : std::uint8_t { power_on = 0, pin = 1, watchdog = 2, brown_out = 3, software = 4 };

enum Capability : std::uint32_t {
    capability_exposure_compensation = 1U << 0U,
    capability_imu = 1U << 1U,
    capability_start_pattern = 1U << 2U,
};

struct BoardHello {
    static constexpr Type type = Type::board_hello;
    std::uint8_t major;
    std::uint8_t minor;
    std::uint8_t cameras;  ///< trigger outputs that exist
    ResetCause reset_cause;
    std::uint32_t capabilities;  ///< bits of Capability
    std::int64_t board_time_ns;
    char serial[16];    ///< zero-padded text
    char firmware[16];  ///< zero-padded text
};

enum ExposureFlag : std::uint16_t {
    exposure_measured = 1U << 0U,   ///< both edges were stamped
    exposure_no_start = 1U << 1U,   ///< the start edge did not come in time
    exposure_no_end = 1U << 2U,     ///< the end edge did not come in time
    exposure_late = 1U << 3U,       ///< the trigger left later than the grid asked
    exposure_pattern = 1U << 4U,    ///< part of the start pattern
    exposure_announced = 1U << 5U,  ///< trigger placed by an exposure that the host announced
    exposure_no_strobe = 1U << 6U,  ///< no exposure line is wired: start and end are predicted
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

enum class ImuKind : std::uint8_t { none = 0, adis16448b = 1 };

enum ImuFlag : std::uint16_t {
    imu_checksum_failed = 1U << 0U,
    imu_self_test_failed = 1U << 1U,  ///< the sensor's own diagnosis
    imu_overrun = 1U << 2U,           ///< the sample before was not read in time
};

/// Raw sensor words, sign-extended; the host scales them.
struct ImuSample {
    static constexpr Type type = Type::imu_sample;
    ImuKind kind;
    std::uint8_t imu;
    std::uint16_t flags;   ///< bits of ImuFlag
    std::uint32_t number;  ///< samples taken since boot, modulo 2^32
    std::int64_t time_ns;
    std::int32_t gyro[3];
    std::int32_t accel[3];
    std::int16_t magnetic[3];
    std::int16_t temperature;
    std::uint16_t pressure;
    std::uint16_t reserved;
    std::uint32_t reserved2;
};

enum class EventKind : std::uint8_t {
    trigger_skipped = 1,  ///< the camera was busy; value: the grid tick that got no pulse
    stray_edge = 2,       ///< an exposure edge that belongs to no trigger; value: level
    output_late = 3,      ///< an output word was committed too late; value: ns late
    edge_overflow = 4,    ///< edges came faster than they were read; value: edges lost
};

struct Event {
    static constexpr Type type = Type::event;
    EventKind kind;
    std::uint8_t source;  ///< camera or input number
    std::uint16_t reserved;
    std::uint32_t sequence;  ///< events since boot
    std::int64_t time_ns;
    std::int64_t value;
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
    std::int64_t sent_ns;      ///< this answer, stamped as it left
};

struct Health {
    static constexpr Type type = Type::health;
    std::int64_t board_time_ns;
    std::uint32_t dropped_packets;  ///< not sent because the host did not read
    std::uint32_t receive_errors;   ///< packets from the host that were malformed
    std::uint32_t imu_errors;
    std::uint32_t late_outputs;
    std::uint32_t lost_edges;
    std::uint32_t output_queue_max;  ///< high-water mark
};

enum class LogLevel : std::uint8_t { error = 3, warning = 4, info = 6, debug = 7 };

struct Log {
    static constexpr Type type = Type::log;
    LogLevel level;
    char text[max_log_text - 1];  ///< zero-padded
};

enum CameraFlag : std::uint32_t {
    camera_enabled = 1U << 0U,
    camera_trigger_inverted = 1U << 1U,  ///< pulses are low
    camera_strobe_inverted = 1U << 2U,   ///< the exposure line is low while exposing
    camera_no_strobe = 1U << 3U,         ///< no exposure line is wired
};

struct CameraConfiguration {
    std::uint32_t flags;           ///< bits of CameraFlag
    std::uint32_t rate_uhz;        ///< grid rate, micro-hertz: 100'000 to 1'000'000'000
    std::uint32_t phase_ns;        ///< grid points are at start + phase + k / rate
    std::uint32_t pulse_ns;        ///< trigger pulse width: 1'000 to 10'000'000
    std::uint32_t latency_ns;      ///< trigger to start of exposure: up to 100'000'000
    std::uint32_t gap_ns;          ///< least time from end of exposure to the next trigger
    std::int64_t exposure_ns;      ///< expected until one was measured or announced
    std::int64_t max_exposure_ns;  ///< an exposure that lasts longer is given up
};

struct ImuConfiguration {
    ImuKind kind;
    std::uint8_t reserved[3];
    std::uint32_t rate_uhz;  ///< sample rate, micro-hertz: 1'000'000 to 1'000'000'000
};

/// The whole configuration; taken as a whole or not at all, and only while stopped.
struct Configuration {
    static constexpr Type type = Type::configuration;
    std::uint32_t id;  ///< repeated in the answer
    std::uint32_t reserved;
    CameraConfiguration cameras[camera_count];
    ImuConfiguration imu;
};

enum class ConfigurationStatus : std::uint8_t { taken = 0, out_of_range = 1, unknown_imu = 2, running = 3 };
enum class ConfigurationField : std::uint8_t {
    none = 0,
    rate = 1,
    pulse = 2,
    latency = 3,
    gap = 4,
    exposure = 5,
    max_exposure = 6,
    phase = 7,
    imu_kind = 8,
    imu_rate = 9,
};

struct ConfigurationAnswer {
    static constexpr Type type = Type::configuration_answer;
    std::uint32_t id;
    ConfigurationStatus status;
    std::uint8_t camera;  ///< of the refused field
    ConfigurationField field;
    std::uint8_t reserved;
    std::int64_t minimum;  ///< of the refused field
    std::int64_t maximum;
    Configuration taken;  ///< what is in force after this answer
};

enum StartFlag : std::uint8_t {
    start_pattern = 1U << 0U,  ///< begin with the pattern of irregular gaps
};

/// Starts the cameras of the mask; one that runs already begins its pattern anew.
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

/// The start pattern: grid points 0..19 after start that get a pulse, bit 0 first; afterwards all do. Its
/// gaps are 1 2 1 3 2 2 3 3 1 1: no two neighbouring gaps stand in it twice, so that three frames name their
/// triggers.
inline constexpr std::uint32_t start_pattern_bits = 0b1110'0100'1010'1001'1011;
inline constexpr unsigned start_pattern_length = 20;

static_assert(sizeof(Header) == 12 && sizeof(HostHello) == 4 && sizeof(BoardHello) == 48);
static_assert(sizeof(Exposure) == 48 && sizeof(ImuSample) == 56 && sizeof(Event) == 24);
static_assert(sizeof(ClockRequest) == 8 && sizeof(ClockAnswer) == 24 && sizeof(Health) == 32 &&
              sizeof(Log) == 96);
static_assert(sizeof(CameraConfiguration) == 40 && sizeof(Configuration) == 176);
static_assert(sizeof(ConfigurationAnswer) == 200);
static_assert(sizeof(Start) == 4 && sizeof(Stop) == 4 && sizeof(ExpectedExposure) == 24 &&
              sizeof(Reboot) == 8);

/// Size of the payload of `type`, or 0 when the type is unknown.
constexpr std::size_t payload_size(Type type) {
    switch (type) {
        case Type::board_hello: return sizeof(BoardHello);
        case Type::exposure: return sizeof(Exposure);
        case Type::imu_sample: return sizeof(ImuSample);
        case Type::event: return sizeof(Event);
        case Type::clock_answer: return sizeof(ClockAnswer);
        case Type::health: return sizeof(Health);
        case Type::log: return sizeof(Log);
        case Type::configuration_answer: return sizeof(ConfigurationAnswer);
        case Type::host_hello: return sizeof(HostHello);
        case Type::configuration: return sizeof(Configuration);
        case Type::start: return sizeof(Start);
        case Type::stop: return sizeof(Stop);
        case Type::clock_request: return sizeof(ClockRequest);
        case Type::expected_exposure: return sizeof(ExpectedExposure);
        case Type::reboot: return sizeof(Reboot);
    }
    return 0;
}

}  // namespace versavis::wire
