// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/lidar_packet.hpp"

#include <algorithm>
#include <array>
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
    for (const auto parse : {velodyne_data, velodyne_position, hesai_gps, livox, ouster})
        if (auto packet = parse(datagram)) return packet;
    return std::nullopt;
}

}  // namespace versavis::client
