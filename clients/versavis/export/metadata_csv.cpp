// SPDX-License-Identifier: BSD-3-Clause
#include "export/metadata_csv.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

std::string known(std::int64_t value) { return value == 0 ? "" : fmt::format("{}", value); }

std::string sigma(std::uint32_t ns) { return ns == sigma_unknown ? "" : fmt::format("{}", ns); }

/// Empty: not known.
std::string measured(float value) { return std::isnan(value) ? "" : fmt::format("{}", value); }

int flag(std::uint32_t flags, std::uint32_t which) { return (flags & which) != 0 ? 1 : 0; }

template <class... T>
std::string row(const T&... values) {
    std::string text;
    ((text += fmt::format("{}{}", text.empty() ? "" : ",", values)), ...);
    return text;
}

std::string common(const RecordedItem& item) {
    return fmt::format("{},{},{:016x}", item.time.ns, item.number, item.life);
}

std::string frame_row(const RecordedItem& item) {
    const auto data = unpack<FrameMetadata>(item.metadata);
    const SensorState sensor = unpack_sensor_state(item.attributes);
    return row(common(item), data.epoch, sigma(data.sigma_ns), to_string(data.stamp_kind()),
               flag(data.flags, flag_suspect), flag(data.flags, flag_holdover),
               flag(data.flags, flag_clamped), flag(data.flags, flag_sensor_error), data.trigger,
               data.tick(), data.block_id, data.board_time.ns, data.host_time.ns, data.arrival.ns,
               known(data.camera_time.ns), known(data.exposure.ns), data.delay_ns, data.width,
               data.height, data.stride, pixel_format_name(data.pixel_format),
               measured(sensor.gain), measured(sensor.temperature_c));
}

std::string imu_row(const RecordedItem& item) {
    const auto data = unpack<ImuMetadata>(item.metadata);
    return row(common(item), data.epoch, sigma(data.sigma_ns), flag(data.flags, flag_suspect),
               flag(data.flags, flag_holdover), flag(data.flags, flag_clamped),
               flag(data.flags, flag_sensor_error), flag(data.flags, flag_repeated), data.number,
               data.board_time.ns, data.host_time.ns, data.filter_delay.ns,
               flag(data.flags, flag_accel_age) != 0 ? fmt::format("{}", data.accel_age_ns) : "",
               data.gyro[0], data.gyro[1], data.gyro[2], data.accel[0], data.accel[1],
               data.accel[2], measured(data.magnetic[0]), measured(data.magnetic[1]),
               measured(data.magnetic[2]), measured(data.temperature), measured(data.pressure));
}

/// In quotes where it needs them.
std::string text(std::string value) {
    if (value.find_first_of(",\"\r\n") == std::string::npos) return value;
    std::string quoted = "\"";
    for (const char one : value) quoted += one == '"' ? "\"\"" : std::string(1, one);
    return quoted + "\"";
}

std::string event_row(const RecordedItem& item) {
    const auto data = unpack<EventMetadata>(item.metadata);
    const std::string name(data.source_name, strnlen(data.source_name, sizeof data.source_name));
    return row(common(item), data.epoch, sigma(data.sigma_ns), to_string(data.kind),
               to_string(data.reason), data.source, text(name), data.value, data.expected,
               data.count, known(data.board_time.ns), data.host_time.ns,
               flag(data.flags, flag_suspect));
}

constexpr auto common_columns = "time_ns,number,life,epoch,sigma_ns";

}  // namespace

std::string csv_columns(ring::StreamKind kind) {
    switch (kind) {
        case ring::StreamKind::frames:
            return fmt::format(
                "{},kind,suspect,holdover,clamped,sensor_error,trigger,tick,block_id,"
                "board_time_ns,host_time_ns,arrival_ns,camera_time_ns,exposure_ns,delay_ns,width,"
                "height,stride,pixel_format,gain,temperature_c",
                common_columns);
        case ring::StreamKind::imu:
            return fmt::format(
                "{},suspect,holdover,clamped,sensor_error,repeated,sample,board_time_ns,"
                "host_time_ns,filter_delay_ns,accel_age_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,"
                "accel_z,magnetic_x,magnetic_y,magnetic_z,temperature,pressure",
                common_columns);
        case ring::StreamKind::events:
            return fmt::format(
                "{},kind,reason,source,source_name,value,expected,count,board_time_ns,"
                "host_time_ns,suspect",
                common_columns);
        default: return {};
    }
}

std::string csv_row(const RecordedItem& item) {
    switch (item.kind) {
        case ring::StreamKind::frames: return frame_row(item);
        case ring::StreamKind::imu: return imu_row(item);
        case ring::StreamKind::events: return event_row(item);
        default: return {};
    }
}

}  // namespace versavis::client
