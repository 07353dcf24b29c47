// SPDX-License-Identifier: BSD-3-Clause
// Packets of GigE Vision's stream protocol. Any bytes may be given to these functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace versavis::daemon::gvsp {

using Bytes = std::span<const std::uint8_t>;

enum class Format : std::uint8_t { leader = 1, trailer = 2, payload = 3 };

struct Packet {
    std::uint64_t block_id = 0;
    std::uint32_t id = 0;  ///< 0: the leader
    Format format = Format::payload;
    bool extended = false;  ///< block ids of 64 bits, else of 16
    Bytes body;
};

/// None: it is cut, of another format, or says that the camera has not what it was asked for.
std::optional<Packet> parse_packet(Bytes datagram);

struct Leader {
    bool image = false;  ///< a plain one; else nothing of what follows is known
    std::uint64_t ticks = 0;
    std::uint32_t pixel_format = 0;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t padding_x = 0;  ///< bytes at the end of each row
};

/// None: it is cut.
std::optional<Leader> parse_leader(Bytes body);

/// What an IPv4 packet carries by UDP; empty: it is cut.
Bytes udp_body(Bytes ip_packet);

/// Bytes of a frame that a packet of this size, IP header included, carries; 0: none.
std::size_t data_per_packet(std::size_t packet_size, bool extended);

/// Packets `first` to `last` of a frame.
struct PacketRange {
    std::uint64_t block_id = 0;
    bool extended = false;
    std::uint32_t first = 0;
    std::uint32_t last = 0;
};

/// The command of the control protocol that asks for them.
std::vector<std::uint8_t> resend_request(const PacketRange& range, std::uint16_t request);

}  // namespace versavis::daemon::gvsp
