// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/fields.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "versavis/metadata.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis {

namespace {

using Type = FieldType;
using If = UnknownIf;

constexpr auto gain_offset = static_cast<std::uint16_t>(ring::metadata_size);
constexpr auto temperature_offset = static_cast<std::uint16_t>(gain_offset + sizeof(float));

constexpr Field frame_fields[] = {
    {"epoch", offsetof(FrameMetadata, epoch), Type::u32},
    {"sigma_ns", offsetof(FrameMetadata, sigma_ns), Type::u32, If::ones},
    {"kind", offsetof(FrameMetadata, flags), Type::stamp_kind},
    {"suspect", offsetof(FrameMetadata, flags), Type::flag, If::never, 0, 1, flag_suspect},
    {"holdover", offsetof(FrameMetadata, flags), Type::flag, If::never, 0, 1, flag_holdover},
    {"clamped", offsetof(FrameMetadata, flags), Type::flag, If::never, 0, 1, flag_clamped},
    {"sensor_error", offsetof(FrameMetadata, flags), Type::flag, If::never, 0, 1,
     flag_sensor_error},
    {"camera_length", offsetof(FrameMetadata, flags), Type::flag, If::never, 6, 1,
     flag_camera_length},
    {"second_doubted", offsetof(FrameMetadata, flags), Type::flag, If::never, 7, 1,
     flag_second_doubted},
    {"flags", offsetof(FrameMetadata, flags), Type::u32},
    {"trigger", offsetof(FrameMetadata, trigger), Type::u64, If::zero},
    {"tick", offsetof(FrameMetadata, tick_low), Type::tick, If::without_trigger},
    {"block_id", offsetof(FrameMetadata, block_id), Type::u64},
    {"board_time_ns", offsetof(FrameMetadata, board_time), Type::i64, If::zero},
    {"host_time_ns", offsetof(FrameMetadata, host_time), Type::i64},
    {"arrival_ns", offsetof(FrameMetadata, arrival), Type::i64},
    {"camera_time_ns", offsetof(FrameMetadata, camera_time), Type::i64, If::zero},
    {"exposure_ns", offsetof(FrameMetadata, exposure), Type::i64, If::zero},
    {"delay_ns", offsetof(FrameMetadata, delay_ns), Type::i32, If::never, 3},
    {"width", offsetof(FrameMetadata, width), Type::u32},
    {"height", offsetof(FrameMetadata, height), Type::u32},
    {"stride", offsetof(FrameMetadata, stride), Type::u32},
    {"pixel_format", offsetof(FrameMetadata, pixel_format), Type::u32},
    {"format", offsetof(FrameMetadata, pixel_format), Type::pixel_format},
    {"gain", gain_offset, Type::f32, If::nan, 6},
    {"temperature_c", temperature_offset, Type::f32, If::nan, 6},
};

constexpr Field imu_fields[] = {
    {"epoch", offsetof(ImuMetadata, epoch), Type::u32},
    {"sigma_ns", offsetof(ImuMetadata, sigma_ns), Type::u32, If::ones},
    {"suspect", offsetof(ImuMetadata, flags), Type::flag, If::never, 0, 1, flag_suspect},
    {"holdover", offsetof(ImuMetadata, flags), Type::flag, If::never, 0, 1, flag_holdover},
    {"clamped", offsetof(ImuMetadata, flags), Type::flag, If::never, 0, 1, flag_clamped},
    {"sensor_error", offsetof(ImuMetadata, flags), Type::flag, If::never, 0, 1, flag_sensor_error},
    {"repeated", offsetof(ImuMetadata, flags), Type::flag, If::never, 4, 1, flag_repeated},
    {"second_doubted", offsetof(ImuMetadata, flags), Type::flag, If::never, 7, 1,
     flag_second_doubted},
    {"flags", offsetof(ImuMetadata, flags), Type::u32},
    {"sample", offsetof(ImuMetadata, number), Type::u64},
    {"board_time_ns", offsetof(ImuMetadata, board_time), Type::i64},
    {"host_time_ns", offsetof(ImuMetadata, host_time), Type::i64},
    {"filter_delay_ns", offsetof(ImuMetadata, filter_delay), Type::i64, If::never, 3},
    {"accel_age_ns", offsetof(ImuMetadata, accel_age_ns), Type::i32, If::without_flag, 4, 1,
     flag_accel_age},
    {"gyro_rad_s", offsetof(ImuMetadata, gyro), Type::f32, If::nan, 0, 3},
    {"accel_m_s2", offsetof(ImuMetadata, accel), Type::f32, If::nan, 0, 3},
    {"magnetic_t", offsetof(ImuMetadata, magnetic), Type::f32, If::nan, 0, 3},
    {"temperature_c", offsetof(ImuMetadata, temperature), Type::f32, If::nan},
    {"pressure_pa", offsetof(ImuMetadata, pressure), Type::f32, If::nan},
};

constexpr Field event_fields[] = {
    {"epoch", offsetof(EventMetadata, epoch), Type::u32},
    {"sigma_ns", offsetof(EventMetadata, sigma_ns), Type::u32, If::ones},
    {"kind", offsetof(EventMetadata, kind), Type::event_kind},
    {"reason", offsetof(EventMetadata, reason), Type::event_reason},
    {"source", offsetof(EventMetadata, source), Type::u32},
    {"source_name", offsetof(EventMetadata, source_name), Type::text},
    {"value", offsetof(EventMetadata, value), Type::i64},
    {"expected", offsetof(EventMetadata, expected), Type::i64, If::never, 3},
    {"count", offsetof(EventMetadata, count), Type::u32, If::never, 4},
    {"board_time_ns", offsetof(EventMetadata, board_time), Type::i64, If::zero},
    {"host_time_ns", offsetof(EventMetadata, host_time), Type::i64},
    {"suspect", offsetof(EventMetadata, flags), Type::flag, If::never, 0, 1, flag_suspect},
    {"second_doubted", offsetof(EventMetadata, flags), Type::flag, If::never, 7, 1,
     flag_second_doubted},
    {"flags", offsetof(EventMetadata, flags), Type::u32},
};

constexpr Field nmea_fields[] = {
    {"epoch", offsetof(NmeaMetadata, epoch), Type::u32},
    {"sigma_ns", offsetof(NmeaMetadata, sigma_ns), Type::u32, If::ones},
    {"suspect", offsetof(NmeaMetadata, flags), Type::flag, If::never, 0, 1, flag_suspect},
    {"holdover", offsetof(NmeaMetadata, flags), Type::flag, If::never, 0, 1, flag_holdover},
    {"clamped", offsetof(NmeaMetadata, flags), Type::flag, If::never, 0, 1, flag_clamped},
    {"sensor_error", offsetof(NmeaMetadata, flags), Type::flag, If::never, 0, 1, flag_sensor_error},
    {"second_doubted", offsetof(NmeaMetadata, flags), Type::flag, If::never, 7, 1,
     flag_second_doubted},
    {"flags", offsetof(NmeaMetadata, flags), Type::u32},
    {"sentence", offsetof(NmeaMetadata, number), Type::u64},
    {"board_time_ns", offsetof(NmeaMetadata, board_time), Type::i64},
    {"host_time_ns", offsetof(NmeaMetadata, host_time), Type::i64},
};

constexpr std::size_t size_of(const Field& field) {
    switch (field.type) {
        case Type::u64:
        case Type::i64: return 8;
        case Type::text: return sizeof EventMetadata::source_name;
        default: return std::size_t{4} * field.count;
    }
}

/// Each byte of the metadata before `end` is that of a field.
template <std::size_t N>
constexpr bool complete(const Field (&fields)[N], std::size_t end) {
    bool covered[ring::metadata_size + 2 * sizeof(float)] = {};
    for (const Field& field : fields) {
        for (std::size_t i = 0; i < size_of(field); ++i) covered[field.offset + i] = true;
        if (field.type != Type::tick) continue;
        for (std::size_t i = 0; i < 4; ++i) covered[offsetof(FrameMetadata, tick_high) + i] = true;
    }
    for (std::size_t i = 0; i < end; ++i)
        if (!covered[i]) return false;
    return true;
}
static_assert(complete(frame_fields, ring::metadata_size + 2 * sizeof(float)));
static_assert(complete(imu_fields, offsetof(ImuMetadata, reserved)));
static_assert(complete(event_fields, offsetof(EventMetadata, reserved)));
static_assert(complete(nmea_fields, offsetof(NmeaMetadata, reserved)));

template <std::size_t N>
Fields list(const Field (&fields)[N]) {
    return {fields, N};
}

/// The metadata and what follows them, as bytes.
struct Bytes {
    std::array<unsigned char, ring::metadata_size + sizeof(std::uint64_t)> bytes;

    Bytes(const ring::Metadata& metadata, std::uint64_t attributes) {
        std::memcpy(bytes.data(), metadata.data(), ring::metadata_size);
        std::memcpy(&bytes[ring::metadata_size], &attributes, sizeof attributes);
    }

    template <class T>
    T at(std::size_t offset) const {
        T value;
        std::memcpy(&value, &bytes[offset], sizeof value);
        return value;
    }
};

template <class T>
FieldValue number(T value, UnknownIf unknown) {
    if (unknown == If::zero && value == 0) return {};
    if (unknown == If::ones && value == static_cast<T>(-1)) return {};
    if constexpr (std::is_signed_v<T>)
        return std::int64_t{value};
    else
        return std::uint64_t{value};
}

FieldValue measured(float value) {
    if (std::isnan(value)) return {};
    return value;
}

std::string text(const Bytes& from, std::size_t offset) {
    const auto* const begin = reinterpret_cast<const char*>(&from.bytes[offset]);
    return {begin, strnlen(begin, sizeof EventMetadata::source_name)};
}

std::uint64_t tick(const Bytes& from) {
    return std::uint64_t{from.at<std::uint32_t>(offsetof(FrameMetadata, tick_high))} << 32U |
           from.at<std::uint32_t>(offsetof(FrameMetadata, tick_low));
}

}  // namespace

Fields fields_of(ring::StreamKind kind) {
    switch (kind) {
        case ring::StreamKind::frames: return list(frame_fields);
        case ring::StreamKind::imu: return list(imu_fields);
        case ring::StreamKind::events: return list(event_fields);
        case ring::StreamKind::nmea: return list(nmea_fields);
        default: return {};
    }
}

FieldValue value_of(const Field& field, const ring::Metadata& metadata, std::uint64_t attributes,
                    unsigned component) {
    const Bytes from(metadata, attributes);
    const auto word = [&] { return from.at<std::uint32_t>(field.offset); };
    // Of all kinds of items that have values with a flag of their own, that is where flags are.
    if (field.unknown == If::without_flag &&
        (from.at<std::uint32_t>(offsetof(ImuMetadata, flags)) & field.flags) == 0)
        return {};
    if (field.unknown == If::without_trigger &&
        from.at<std::uint64_t>(offsetof(FrameMetadata, trigger)) == 0)
        return {};
    switch (field.type) {
        case Type::u32: return number(word(), field.unknown);
        case Type::i32: return number(from.at<std::int32_t>(field.offset), field.unknown);
        case Type::u64: return number(from.at<std::uint64_t>(field.offset), field.unknown);
        case Type::i64: return number(from.at<std::int64_t>(field.offset), field.unknown);
        case Type::f32: return measured(from.at<float>(field.offset + component * sizeof(float)));
        case Type::flag: return (word() & field.flags) != 0;
        case Type::tick: return tick(from);
        case Type::text: return text(from, field.offset);
        case Type::stamp_kind:
            return std::string(to_string(static_cast<StampKind>(word() & stamp_kind_mask)));
        case Type::event_kind: return std::string(to_string(static_cast<EventKind>(word())));
        case Type::event_reason: return std::string(to_string(static_cast<EventReason>(word())));
        case Type::pixel_format: return std::string(pixel_format_name(word()));
    }
    return {};
}

}  // namespace versavis
