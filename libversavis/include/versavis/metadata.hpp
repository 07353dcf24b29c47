// SPDX-License-Identifier: BSD-3-Clause
// What a descriptor says of a frame, a sample, an event or a sentence: 96 bytes of inline metadata.
#pragma once

#include <cstdint>
#include <cstring>
#include <limits>

#include "ring_layout.hpp"
#include "versavis/export.hpp"
#include "versavis/time.hpp"

namespace versavis {

/// Where a frame's stamp comes from, best first but for the last.
enum class StampKind : std::uint32_t {
    measured_middle = 0,  ///< both edges of the exposure were stamped by hardware
    predicted_middle =
        1,  ///< an edge is missing: start or end follow from the configured or expected exposure
    trigger_edge = 2,  ///< only the trigger pulse is known: latency and exposure are as configured
    arrival = 3,       ///< no trigger: the moment the frame arrived on the host
    camera_ptp = 0x403,  ///< by the camera's own clock, which follows PTP; no board saw the
                         ///< exposure. Since ABI 1.10; older readers take it for `arrival`
};

enum ItemFlag : std::uint32_t {
    stamp_kind_mask = 0x403,  ///< StampKind
    flag_suspect = 1U << 2U,  ///< the pairing is not proved: trigger and stamp are a guess
    flag_holdover =
        1U << 3U,             ///< the clocks lost contact, or messages contradict them: sigma grows
    flag_clamped = 1U << 4U,  ///< the stamp was held so that it did not go backwards
    flag_sensor_error = 1U << 5U,    ///< the sensor reported a fault, or its checksum was wrong
    flag_repeated = 1U << 6U,        ///< an IMU sample with the data of the one before
    flag_accel_age = 1U << 7U,       ///< accel_age_ns is measured
    flag_camera_length = 1U << 8U,   ///< the exposure's length is by the camera's own events
    flag_second_doubted = 1U << 9U,  ///< the output time may be off by whole seconds, as receiver
                                     ///< and host differ; sigma does not include that
};

/// A stamp of sigma `sigma_unknown` has no known accuracy.
inline constexpr std::uint32_t sigma_unknown = 0xFFFFFFFFU;

struct FrameMetadata {
    std::uint64_t trigger;   ///< pulses the board had sent to this camera, or triggers by PTP time,
                             ///< this frame's included; 0: not triggered
    std::uint64_t block_id;  ///< the camera's own frame number
    BoardTime board_time;    ///< middle of the exposure; 0: the board did not see it
    HostTime host_time;      ///< middle of the exposure
    HostTime arrival;        ///< the frame was complete on the host
    Duration exposure;       ///< measured, or with flag_camera_length by the camera; 0: unknown
    CameraTime camera_time;  ///< as the camera stamped it; 0: unknown
    std::uint32_t sigma_ns;  ///< one standard deviation of the output time
    std::uint32_t width;
    std::uint32_t height;
    std::uint32_t stride;        ///< bytes from row to row
    std::uint32_t pixel_format;  ///< PFNC code
    std::uint32_t epoch;         ///< trigger numbers and clocks are continuous within one
    std::uint32_t flags;         ///< ItemFlag
    std::uint32_t tick_low;      ///< of tick()
    std::int32_t delay_ns;    ///< of camera's and board's lines, already subtracted from all times
    std::uint32_t tick_high;  ///< of tick()

    StampKind stamp_kind() const { return static_cast<StampKind>(flags & stamp_kind_mask); }

    /// Grid point: equal for cameras that exposed together.
    std::uint64_t tick() const { return std::uint64_t{tick_high} << 32U | tick_low; }
    void set_tick(std::uint64_t tick) {
        tick_low = static_cast<std::uint32_t>(tick);
        tick_high = static_cast<std::uint32_t>(tick >> 32U);
    }
};

/// How a camera's sensor was when it took a frame, by the camera's own account; NaN: not known.
struct SensorState {
    float gain = std::numeric_limits<float>::quiet_NaN();  ///< dB, or the unit of the camera
    float temperature_c = std::numeric_limits<float>::quiet_NaN();
};

struct ImuMetadata {
    BoardTime board_time;  ///< of the sample as the board has it: `filter_delay` after the motion
    HostTime host_time;    ///< of the motion
    std::uint64_t number;  ///< samples since the board's boot
    float gyro[3];         ///< rad/s
    float accel[3];        ///< m/s^2
    float magnetic[3];     ///< tesla; NaN where the part has none
    float temperature;     ///< degree Celsius
    float pressure;        ///< pascal; NaN where the part has none
    std::uint32_t sigma_ns;
    std::uint32_t epoch;
    std::uint32_t flags;    ///< ItemFlag
    Duration filter_delay;  ///< of the part's filter, already subtracted from host and output time
    std::int32_t accel_age_ns;  ///< acceleration before angular rate, not subtracted; 0: unknown
    std::uint32_t reserved;
};

enum class EventKind : std::uint32_t {
    trigger_without_frame = 1,  ///< value: trigger number
    frame_without_trigger = 2,  ///< value: block id
    trigger_skipped = 3,        ///< value: grid tick; the camera was still busy
    stray_edge = 4,             ///< value: level
    output_late = 5,            ///< value: ns
    board_connected = 6,        ///< value: boot nonce
    board_lost = 7,
    camera_connected = 8,
    camera_lost = 9,
    pairing_locked = 10,   ///< value: trigger number of the first proved frame
    pairing_slipped = 11,  ///< value: block id of the frame that contradicted it
    edge_overflow = 12,    ///< value: edges lost
    pps = 13,              ///< an edge of the PPS input; value: edges since the board's boot
    aux_pulse = 14,        ///< an edge of an auxiliary input; source: 0 or 1; value: as for pps
    sync_pulse = 15,       ///< an edge of the sync input; value: as for pps
    input_noisy = 16,      ///< an input is ignored for a second; source: input of the board
    illumination_limited = 17,  ///< the light was cut, or stayed dark; value: ns that it was on
    imu_ready = 18,             ///< value: identity of the part
    imu_failed = 19,            ///< the part is not the one configured; value: what it answered
    imu_silent = 20,            ///< no data-ready edge, end of transfer or bytes arrived
    utc_label = 21,  ///< the PPS pulse at this time was labelled; value: UTC seconds since 1970
    message_doubted = 22,  ///< its witnesses contradict a message of the board: it was not used
    stream_stepped = 23,   ///< messages of one stream agree against those before: they are believed
    output_clock_stepped = 24,  ///< value: ns by which its offset to the host's clock changed
    triggers_skipped = 25,  ///< grid points in a row that were too late; value: tick of the first
    sync_lost = 26,         ///< pulses of the sync input do not fit the grid; value: ns off it
    sync_taken = 27,        ///< the grid follows the sync pulses; value: ns that it moves for that
    configuration_stored = 28,  ///< on the board; value: 1 when it is safe, 0 when that failed
    seconds_differ = 29,      ///< value: whole seconds of the receiver at the board less the host's
    host_undisciplined = 30,  ///< the clock that names the PPS pulses' seconds; value: 1, or 0 when
                              ///< it is disciplined again
    time_pulse = 31,  ///< a time output sent a second's pulse; value: UTC seconds since 1970
};

/// Why a trigger has no frame, or a frame no trigger.
enum class EventReason : std::uint32_t {
    none = 0,
    frame_incomplete = 1,     ///< packets were lost on the way
    frame_missing = 2,        ///< nothing arrived in time
    exposure_missing = 3,     ///< the board's record did not arrive in time
    unproved = 4,             ///< pairing could not prove it; a first PPS has none beside it
    mismatch = 5,             ///< the evidence contradicts the pairing
    no_clock = 7,             ///< board time could not be translated
    wrong_size = 8,           ///< the frame is not of the size the camera announced
    reset = 9,                ///< camera or board restarted in between
    trigger_ignored = 10,     ///< the camera did not expose
    camera_busy = 11,         ///< it was, or would have been, still exposing
    too_late = 12,            ///< the instant had passed before the board got to it
    queue_full = 13,          ///< too many pulses waited on the board
    out_of_order = 14,        ///< this frame, or a newer one, was published before
    no_buffer = 15,           ///< no slot was free: too many frames were waiting
    camera_silent = 16,       ///< nothing at all arrived from the camera
    wrong_exposure = 17,      ///< the exposure line shows another exposure than the camera reports
    implausible_number = 18,  ///< a number does not follow from those before
    implausible_time = 19,    ///< a time does not follow from number, trigger or those before
    implausible_length = 20,  ///< an exposure does not last as long as those before
    implausible_flags = 21,   ///< flags and times of a message contradict each other
    not_yet = 22,             ///< a time that had not come when the message arrived
    too_old = 23,             ///< a time long before the message arrived
    went_back = 24,           ///< its stamp lies before the one before, by more than sigma explains
};

struct EventMetadata {
    EventKind kind;
    std::uint32_t source;  ///< camera, IMU or input number
    EventReason reason;
    std::uint32_t flags;  ///< ItemFlag
    std::int64_t value;
    BoardTime board_time;  ///< 0: not an event of the board
    HostTime host_time;
    std::uint32_t sigma_ns;
    std::uint32_t epoch;
    char source_name[32];   ///< zero-terminated
    std::int64_t expected;  ///< of a message that was doubted: what its witnesses say
    std::uint32_t count;    ///< of triggers_skipped: grid points
    std::uint32_t reserved;
};

/// Of a line that a GNSS receiver at the board sent; the line is the item's payload.
struct NmeaMetadata {
    BoardTime board_time;  ///< its first bit arrived at the board
    HostTime host_time;
    std::uint64_t number;  ///< lines since the board's boot
    std::uint32_t sigma_ns;
    std::uint32_t epoch;
    std::uint32_t flags;  ///< ItemFlag; flag_sensor_error: its checksum is wrong, or there is none
    std::uint32_t reserved[15];
};

static_assert(sizeof(FrameMetadata) == ring::metadata_size, "96 bytes of inline metadata");
static_assert(sizeof(ImuMetadata) == ring::metadata_size, "96 bytes of inline metadata");
static_assert(sizeof(EventMetadata) == ring::metadata_size, "96 bytes of inline metadata");
static_assert(sizeof(NmeaMetadata) == ring::metadata_size, "96 bytes of inline metadata");

/// As attributes of a frame's payload.
inline std::uint64_t pack(const SensorState& state) {
    static_assert(sizeof(SensorState) == sizeof(std::uint64_t));
    std::uint64_t attributes = 0;
    std::memcpy(&attributes, &state, sizeof attributes);
    return attributes;
}

inline SensorState unpack_sensor_state(std::uint64_t attributes) {
    SensorState state;
    std::memcpy(static_cast<void*>(&state), &attributes, sizeof state);
    return state;
}

template <class T>
ring::Metadata pack(const T& metadata) {
    ring::Metadata words;
    static_assert(sizeof words == sizeof metadata, "96 bytes of inline metadata");
    std::memcpy(words.data(), &metadata, sizeof words);
    return words;
}

template <class T>
T unpack(const ring::Metadata& words) {
    T metadata;
    std::memcpy(static_cast<void*>(&metadata), words.data(), sizeof metadata);
    return metadata;
}

VERSAVIS_API const char* to_string(StampKind kind);
VERSAVIS_API const char* to_string(EventKind kind);
VERSAVIS_API const char* to_string(EventReason reason);

}  // namespace versavis
