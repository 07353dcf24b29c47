// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/lidar_packet.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

namespace versavis::client {

namespace {

constexpr Duration hour = seconds(3600);

/// Little-endian.
template <class Integer>
Integer read_at(std::span<const std::uint8_t> bytes, std::size_t at) {
    Integer value{};
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

bool begins_with(std::span<const std::uint8_t> bytes, std::uint8_t first, std::uint8_t second) {
    return bytes.size() >= 2 && bytes[0] == first && bytes[1] == second;
}

/// VLP-16 User Manual 63-9243, 9.3.2: 12 blocks, the time of the first firing in us since the hour,
/// two bytes for mode and product.
std::optional<LidarPacket> velodyne_data(const Datagram& datagram) {
    constexpr std::size_t size = 1206;
    constexpr std::size_t time_at = 1200;
    constexpr std::size_t product_at = 1205;
    constexpr std::uint8_t vlp16 = 0x22;
    constexpr Duration of_vlp16 = microseconds(1327);  // 24 firings in 55.296 us each
    if (datagram.size != size || datagram.payload.size() < size ||
        !begins_with(datagram.payload, 0xFF, 0xEE))
        return std::nullopt;
    LidarPacket packet{"Velodyne"};
    packet.time = microseconds(read_at<std::uint32_t>(datagram.payload, time_at));
    packet.span = hour;
    if (datagram.payload[product_at] == vlp16) packet.covers = of_vlp16;
    return packet;
}

/// The same, 9.3.3, tables 9-3 and 9-4; offsets without the 42 bytes of headers.
std::optional<LidarPacket> velodyne_position(const Datagram& datagram) {
    constexpr std::uint16_t port = 8308;
    constexpr std::size_t size = 512;
    constexpr std::size_t status_at = 0xF4 - 0x2A;
    if (datagram.size != size || datagram.payload.size() < size ||
        (datagram.port != port && datagram.source_port != port))
        return std::nullopt;
    constexpr std::array<const char*, 4> words{"no PPS", "synchronising to PPS", "PPS locked",
                                               "PPS error"};
    constexpr std::uint8_t locked = 2;
    const std::uint8_t status = datagram.payload[status_at];
    if (status >= words.size()) return std::nullopt;
    LidarPacket packet{"Velodyne"};
    packet.lock = status == locked ? LidarLock::locked : LidarLock::none;
    packet.remark = words[status];
    return packet;
}

/// Hesai Pandar64 and Pandar128 user manuals, 3.2.2: GPS packets.
std::optional<LidarPacket> hesai_gps(const Datagram& datagram) {
    constexpr std::uint16_t port = 10110;
    constexpr std::size_t size = 512;
    constexpr std::size_t status_at = 2 + 6 + 6 + 4 + 84 + 404;
    if (datagram.size != size || datagram.payload.size() < size ||
        (datagram.port != port && datagram.source_port != port) ||
        !begins_with(datagram.payload, 0xFF, 0xEE))
        return std::nullopt;
    const std::uint8_t sentence = datagram.payload[status_at];
    const bool pulse = datagram.payload[status_at + 1] != 0;
    const bool valid = sentence == 'A' || (sentence > '0' && sentence <= '9');
    LidarPacket packet{"Hesai"};
    packet.lock = pulse && valid ? LidarLock::locked : LidarLock::none;
    packet.remark = std::string(pulse ? "PPS locked" : "PPS not locked") +
                    (valid ? ", sentence valid" : ", no valid sentence");
    return packet;
}

std::optional<Duration> since_1970(int year, unsigned month, unsigned day, unsigned hours,
                                   unsigned minutes, unsigned secs) {
    const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                           std::chrono::day(day)};
    if (!date.ok() || hours > 23 || minutes > 59 || secs > 60) return std::nullopt;
    const std::int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
    return seconds(days * 86'400 + hours * 3600 + minutes * 60 + secs);
}

/// Hesai user manuals, "Point Cloud Data Packet", tail: whole seconds as a date, and us; some count
/// years since 1900, others since 2000.
std::optional<LidarPacket> hesai_points(const Datagram& datagram) {
    struct Layout {
        std::size_t size;
        std::uint8_t first;
        std::uint8_t second;
        std::size_t date_at;
        std::size_t us_at;
    };
    constexpr std::size_t sequence = 4;  // ends some packets, as the LiDAR is set
    constexpr Layout layouts[] = {{1262, 0xFF, 0xEE, 1256, 1250},             // Pandar40P
                                  {1262 + sequence, 0xFF, 0xEE, 1256, 1250},  //
                                  {1194, 0xEE, 0xFF, 1188, 1182},             // Pandar64
                                  {1194 + sequence, 0xEE, 0xFF, 1188, 1182},  //
                                  {1080, 0xEE, 0xFF, 1065, 1071},             // PandarXT-32
                                  {1072, 0xEE, 0xFF, 1062, 1056},             // PandarQT
                                  {861, 0xEE, 0xFF, 820, 826}};               // Pandar128, OT128
    const auto& bytes = datagram.payload;
    const auto* layout =
        std::find_if(std::begin(layouts), std::end(layouts), [&](const Layout& known) {
            return datagram.size == known.size && begins_with(bytes, known.first, known.second);
        });
    if (layout == std::end(layouts) || bytes.size() < datagram.size) return std::nullopt;
    const auto date = bytes.subspan(layout->date_at, 6);
    const auto us = read_at<std::uint32_t>(bytes, layout->us_at);
    const int year = date[0] + (date[0] >= 100 ? 1900 : 2000);
    LidarPacket packet{"Hesai"};
    packet.time = since_1970(year, date[1], date[2], date[3], date[4], date[5]);
    if (packet.time) packet.time = *packet.time + microseconds(us);
    return packet;
}

/// RoboSense user guides, MSOP header, big-endian: of the RS-16, RS-32 and RS-Bpearl a date, of
/// others seconds since 1970 and us. A date begins with its year since 2000, which is not 0.
std::optional<LidarPacket> robosense(const Datagram& datagram) {
    struct Layout {
        std::size_t size;
        std::array<std::uint8_t, 4> id;
        std::size_t time_at;
    };
    constexpr Layout layouts[] = {{1248, {0x55, 0xAA, 0x05, 0x0A}, 20},   // with Helios
                                  {1248, {0x55, 0xAA, 0x05, 0x5A}, 10},   // RS-80, Ruby
                                  {1210, {0x55, 0xAA, 0x5A, 0xA5}, 10}};  // M1
    const auto& bytes = datagram.payload;
    const auto* layout =
        std::find_if(std::begin(layouts), std::end(layouts), [&](const Layout& known) {
            return datagram.size == known.size && bytes.size() >= datagram.size &&
                   std::equal(known.id.begin(), known.id.end(), bytes.begin());
        });
    if (layout == std::end(layouts)) return std::nullopt;
    const auto field = bytes.subspan(layout->time_at, 10);
    const auto number = [&](std::size_t at, std::size_t size) {
        std::int64_t value = 0;
        for (std::size_t i = at; i < at + size; ++i) value = value << 8U | field[i];
        return value;
    };
    constexpr std::int64_t last_s = std::int64_t{1} << 33U;  // the year 2242
    LidarPacket packet{"RoboSense"};
    if (field[0] != 0) {
        packet.time = since_1970(2000 + field[0], field[1], field[2], field[3], field[4], field[5]);
        if (packet.time)
            packet.time = *packet.time + milliseconds(number(6, 2)) + microseconds(number(8, 2));
    } else if (number(0, 6) < last_s && number(6, 4) < 1'000'000) {
        packet.time = seconds(number(0, 6)) + microseconds(number(6, 4));
    }
    return packet;
}

/// Livox LiDAR communication protocol of Mid-360 and HAP, point cloud and IMU data.
std::optional<LidarPacket> livox(const Datagram& datagram) {
    constexpr std::uint16_t ports[] = {56300, 56400, 57000, 58000};
    constexpr std::size_t header = 36;
    constexpr std::size_t length_at = 1;
    constexpr std::size_t interval_at = 3;
    constexpr std::size_t type_at = 11;
    constexpr std::size_t time_at = 28;
    if (std::count(std::begin(ports), std::end(ports), datagram.source_port) == 0 ||
        datagram.payload.size() < header || datagram.payload[0] != 0 ||
        read_at<std::uint16_t>(datagram.payload, length_at) != datagram.size)
        return std::nullopt;
    constexpr std::array<const char*, 3> words{"no source of time", "PTP",
                                               "GPS: pulse and sentence"};
    const std::uint8_t type = datagram.payload[type_at];
    if (type >= words.size()) return std::nullopt;
    LidarPacket packet{"Livox"};
    packet.lock = type == 0 ? LidarLock::none : LidarLock::locked;
    packet.remark = words[type];
    packet.time = nanoseconds(read_at<std::int64_t>(datagram.payload, time_at));
    constexpr std::int64_t unit_ns = 100;
    packet.covers = nanoseconds(read_at<std::uint16_t>(datagram.payload, interval_at) * unit_ns);
    return packet;
}

/// Ouster sensor data format: legacy packets begin with a column, whose first field is its time;
/// later ones with a header of 32 bytes.
std::optional<LidarPacket> ouster(const Datagram& datagram) {
    constexpr std::uint16_t port = 7502;
    constexpr std::size_t legacy_sizes[] = {3392, 6464, 12608, 24896};  // 16, 32, 64, 128 beams
    constexpr std::size_t header = 32;
    constexpr std::uint8_t lidar_packet = 1;
    if ((datagram.port != port && datagram.source_port != port) ||
        datagram.payload.size() < header + sizeof(std::int64_t))
        return std::nullopt;
    const bool legacy =
        std::count(std::begin(legacy_sizes), std::end(legacy_sizes), datagram.size) != 0;
    if (!legacy && datagram.payload[0] != lidar_packet) return std::nullopt;
    LidarPacket packet{"Ouster"};
    packet.time = nanoseconds(read_at<std::int64_t>(datagram.payload, legacy ? 0 : header));
    return packet;
}

}  // namespace

std::optional<LidarPacket> lidar_packet_of(const Datagram& datagram) {
    for (const auto parse :
         {velodyne_data, velodyne_position, hesai_gps, hesai_points, robosense, livox, ouster})
        if (auto packet = parse(datagram)) return packet;
    return std::nullopt;
}

}  // namespace versavis::client
