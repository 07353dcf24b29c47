// SPDX-License-Identifier: BSD-3-Clause
// Packets that one host sends to a UDP port of this one, by a packet socket: the kernel puts them
// into memory that is shared with it, and need not wake anybody.
#pragma once

#include <netinet/in.h>

#include <cstddef>
#include <cstdint>
#include <span>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"

namespace versavis::daemon {

class PacketRing {
 public:
    /// For packets of at most so many bytes, IP header included; larger ones are dropped.
    static Expected<PacketRing> open(in_addr own, in_addr from, std::size_t packet_size);
    ~PacketRing();
    PacketRing(PacketRing&& other) noexcept;
    PacketRing& operator=(PacketRing&&) = delete;
    PacketRing(const PacketRing&) = delete;

    /// UDP port that packets must be sent to.
    std::uint16_t port() const { return port_; }

    /// Readable when there is a packet.
    int descriptor() const { return packets_.get(); }

    /// The oldest one, IP header included, until release(); empty: there is none. One that was cut
    /// has no bytes behind its header.
    std::span<const std::uint8_t> front() const;
    void release();

    /// Sends from that port.
    void send(std::span<const std::uint8_t> datagram, std::uint16_t to_port) const;

 private:
    PacketRing(in_addr from, std::size_t packet_size);
    Expected<> bind(in_addr own);
    std::uint8_t* slot() const;

    in_addr from_{};
    FileDescriptor datagrams_;  ///< holds the port, and receives nothing
    FileDescriptor packets_;
    std::uint16_t port_ = 0;
    std::size_t slot_size_ = 0;
    std::uint8_t* memory_ = nullptr;
    std::size_t next_ = 0;  ///< slot
};

}  // namespace versavis::daemon
