// SPDX-License-Identifier: BSD-3-Clause
// How cameras share a network link: whether their frames fit, and the pause between packets that
// spreads them.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// What one camera sends over a link.
struct BandwidthNeed {
    std::string link;               ///< name of the host's network interface
    double link_mbps = 0;           ///< its speed; 0: unknown, nothing is planned
    std::uint64_t frame_size = 0;   ///< bytes
    std::uint32_t packet_size = 0;  ///< with IP and UDP headers, as GevSCPSPacketSize
    double rate_hz = 0;
};

struct BandwidthShare {
    std::string link;             ///< as of the need; empty: nothing is known of it
    double needed_mbps = 0;       ///< of this camera, with all headers
    double link_needed_mbps = 0;  ///< of all cameras on its link
    double link_mbps = 0;
    Duration packet_delay;  ///< pause after each packet

    bool fits() const { return link_mbps == 0 || link_needed_mbps <= link_mbps; }
};

/// Bits per second that a camera needs: each packet has 20 + 8 bytes of IP and UDP, 8 of GVSP, and
/// on the wire 38 of Ethernet; each frame has a leader and a trailer.
double needed_mbps(const BandwidthNeed& need);

/// Thread-safe: every camera says what it needs, and asks for its share now and then, as others
/// come and go.
class BandwidthPlan {
 public:
    void join(const std::string& camera, const BandwidthNeed& need);
    void leave(const std::string& camera);

    /// Cameras alone on their link send without pause. Others are spread so that each keeps to the
    /// part of the link that it needs, and the bursts of cameras that expose together do not meet
    /// in a switch.
    BandwidthShare share(const std::string& camera) const;

 private:
    mutable std::mutex mutex_;
    std::map<std::string, BandwidthNeed> needs_;
};

/// Speed of a network interface by its driver, in Mbit/s; 0: it does not say, as loopback does not.
double link_speed_mbps(const std::string& interface);

/// The interface that has this IPv4 address; empty when none has.
std::string interface_of(std::uint32_t address_big_endian);

}  // namespace versavis::daemon
