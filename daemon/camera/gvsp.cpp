// SPDX-License-Identifier: BSD-3-Clause
#include "camera/gvsp.hpp"

#include "camera/gvcp.hpp"

namespace versavis::daemon::gvsp {

namespace {

constexpr std::size_t ip_and_udp_header = 28;
constexpr std::size_t udp_header = 8;

/// Status, block id, and format with the packet's id; extended, the ids follow.
constexpr std::size_t header_size = 8;
constexpr std::size_t extended_header_size = 20;
constexpr std::uint8_t extended_flag = 0x80;
constexpr std::uint8_t format_mask = 0x0F;
constexpr std::uint16_t error_status = 0x8000;

constexpr std::uint16_t plain_image = 0x0001;
constexpr std::size_t payload_type_end = 4;
constexpr std::size_t image_leader_size = 36;

std::uint64_t number(Bytes bytes, std::size_t at, unsigned size) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < size; ++i) value = value << 8U | bytes[at + i];
    return value;
}

std::uint32_t word(Bytes bytes, std::size_t at) {
    return static_cast<std::uint32_t>(number(bytes, at, 4));
}

}  // namespace

std::optional<Packet> parse_packet(Bytes datagram) {
    if (datagram.size() < header_size) return std::nullopt;
    Packet packet;
    packet.extended = (datagram[4] & extended_flag) != 0;
    const std::size_t header = packet.extended ? extended_header_size : header_size;
    if (datagram.size() < header || (number(datagram, 0, 2) & error_status) != 0)
        return std::nullopt;
    packet.format = static_cast<Format>(datagram[4] & format_mask);
    packet.block_id = packet.extended ? number(datagram, 8, 8) : number(datagram, 2, 2);
    packet.id = packet.extended ? word(datagram, 16) : word(datagram, 4) & 0xFFFFFFU;
    packet.body = datagram.subspan(header);
    const bool known = packet.format >= Format::leader && packet.format <= Format::payload;
    const bool in_place = (packet.format == Format::leader) == (packet.id == 0);
    return known && in_place && packet.block_id != 0 ? std::optional(packet) : std::nullopt;
}

std::optional<Leader> parse_leader(Bytes body) {
    if (body.size() < payload_type_end) return std::nullopt;
    Leader leader;
    leader.image = number(body, 2, 2) == plain_image;
    if (!leader.image) return leader;
    if (body.size() < image_leader_size) return std::nullopt;
    leader.ticks = number(body, 4, 8);
    leader.pixel_format = word(body, 12);
    leader.width = word(body, 16);
    leader.height = word(body, 20);
    leader.padding_x = static_cast<std::uint32_t>(number(body, 32, 2));
    return leader;
}

Bytes udp_body(Bytes ip_packet) {
    const std::size_t header = ip_packet.empty() ? 0 : (ip_packet[0] & 0x0FU) * std::size_t{4};
    if (ip_packet.size() < header + udp_header) return {};
    const std::size_t size = number(ip_packet, header + 4, 2);
    if (size < udp_header || size > ip_packet.size() - header) return {};
    return ip_packet.subspan(header + udp_header, size - udp_header);
}

std::size_t data_per_packet(std::size_t packet_size, bool extended) {
    const std::size_t headers = ip_and_udp_header + (extended ? extended_header_size : header_size);
    return packet_size > headers ? packet_size - headers : 0;
}

std::vector<std::uint8_t> resend_request(const PacketRange& range, std::uint16_t request) {
    std::vector<std::uint8_t> packet{gvcp_key,
                                     static_cast<std::uint8_t>(range.extended ? 0x10 : 0)};
    put(packet, 0x0040, 2);
    put(packet, range.extended ? 20 : 12, 2);
    put(packet, request, 2);
    put(packet, 0, 2);  // stream channel
    put(packet, range.extended ? 0 : range.block_id, 2);
    put(packet, range.first, 4);
    put(packet, range.last, 4);
    if (range.extended) put(packet, range.block_id, 8);
    return packet;
}

}  // namespace versavis::daemon::gvsp
