// SPDX-License-Identifier: BSD-3-Clause
// The time in the packets of LiDARs, and whether they call it synchronised.
#pragma once

#include <optional>
#include <string>

#include "lidar/capture.hpp"

namespace versavis::client {

enum class LidarLock {
    unknown,  ///< the packet does not say
    none,     ///< its clock runs freely
    locked,
};

struct LidarPacket {
    const char* maker = "";
    LidarLock lock = LidarLock::unknown;
    std::string remark{};  ///< what the packet says of its source of time; empty: nothing
    /// Of the first measurement in the packet, by the LiDAR's clock, modulo `span`; none: the
    /// packet has no time that says when it was made.
    std::optional<Duration> time{};
    Duration span{};    ///< 0: it counts since 1970, or since the LiDAR's start
    Duration covers{};  ///< from the first to the last measurement, at least
};

/// None: the datagram is not of a LiDAR that is known here. Velodyne (data and position packets),
/// Ouster, Livox (of SDK 2), Hesai (points; GPS packets: the lock alone), RoboSense.
std::optional<LidarPacket> lidar_packet_of(const Datagram& datagram);

}  // namespace versavis::client
