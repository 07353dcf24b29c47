// SPDX-License-Identifier: BSD-3-Clause
// The devices as clocks of TIER IV's synchronisation graph: messages GraphUpdate of
// sync_tooling_msgs 1.x, in protobuf, as they are published in std_msgs/UInt8MultiArray.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::ros_client {

/// What a device says of its own clock. The numbers are those of SelfReportedClockStateUpdate.
enum class ClockState : std::uint8_t { unsynchronized = 1, tracking = 2, locked = 3, lost = 4 };

/// GraphUpdate with a SelfReportedClockStateUpdate of the sensor `frame_id`.
std::string clock_state_update(const std::string& source, const std::string& frame_id,
                               ClockState state);

/// GraphUpdate with a ClockDiffMeasurement: time of the sensor `frame_id` less that of the system
/// clock of `hostname`.
std::string clock_difference_update(const std::string& source, const std::string& hostname,
                                    const std::string& frame_id, Duration difference);

/// One instant by two clocks of this host.
struct ClockReading {
    HostTime host;
    std::int64_t realtime_ns = 0;
};

/// States of all cameras and IMUs that the board times, and how far stamps of those that are locked
/// are off the system clock: what the output clock is off, good to some 0.1 ms.
std::vector<std::string> graph_updates(const std::string& hostname, const nlohmann::json& status,
                                       const ClockReading& now);

}  // namespace versavis::ros_client
