// SPDX-License-Identifier: BSD-3-Clause
// UDP datagrams of a network interface, or of a file that tcpdump or Wireshark wrote.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

struct pcap;

namespace versavis::client {

/// One datagram, or the beginning of one: the first fragment, or as much as was captured. Its
/// payload is valid until the next one.
struct Datagram {
    OutputTime arrived;  ///< by CLOCK_REALTIME of the host that captured it
    std::string source;  ///< address
    std::uint16_t source_port = 0;
    std::uint16_t port = 0;
    std::size_t size = 0;  ///< of the whole payload
    std::span<const std::uint8_t> payload;
};

/// The datagram in a frame of link layer `link_type` (DLT_...); none: it is not the beginning of
/// one by UDP and IPv4.
std::optional<Datagram> datagram_of(std::span<const std::uint8_t> frame, int link_type);

class Capture {
 public:
    static Expected<Capture> open_file(const std::string& path);
    /// Needs CAP_NET_RAW.
    static Expected<Capture> open_interface(const std::string& name);

    /// The next one; none: the file has ended, or none came within 100 ms at the interface.
    Expected<std::optional<Datagram>> next();
    bool ended() const { return ended_; }

    /// Frames that the kernel dropped since this program did not read in time.
    std::uint64_t dropped() const;

 private:
    struct Closer {
        void operator()(pcap* handle) const;
    };
    Capture(pcap* handle, std::string name, bool live)
        : handle_(handle), name_(std::move(name)), live_(live) {}

    std::unique_ptr<pcap, Closer> handle_;
    std::string name_;
    bool live_;
    bool ended_ = false;
};

}  // namespace versavis::client
