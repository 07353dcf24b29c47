// SPDX-License-Identifier: BSD-3-Clause
// Every clock that stamps depend on, from status documents: what it follows, by what path, how
// closely, and whether it does.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace versavis::client {

struct ClockNode {
    std::string name;    ///< unique, as "default:board" or "default/cam0"
    std::string kind;    ///< host, port, board, ptp, camera, imu, receiver or lidar
    std::string parent;  ///< name of the clock that it is compared with; empty: the root
    std::string path;    ///< how they are compared, or one follows the other
    std::string state;
    bool good = true;
    std::optional<std::int64_t> bound_ns;   ///< what the comparison may be off, at most
    std::optional<std::int64_t> offset_ns;  ///< from its parent, as far as it should have none
    std::string hint;                       ///< what to do; empty: nothing
};

/// CLOCK_REALTIME of this computer, by the kernel.
struct HostClock {
    bool synchronised = false;
    std::int64_t max_error_ns = 0;
};

/// A port of a ptp4l of this computer.
struct PtpPort {
    std::string name;
    std::string state;  ///< as pmc prints it
    std::string grandmaster;
    std::optional<std::int64_t> offset_ns;
};

using InstanceStatus = std::pair<std::string, nlohmann::json>;

/// Parents come before what follows them.
std::vector<ClockNode> clock_graph(const HostClock& host, const std::vector<PtpPort>& ports,
                                   const std::vector<InstanceStatus>& services);

std::string graph_text(const std::vector<ClockNode>& clocks);
nlohmann::json graph_json(const std::vector<ClockNode>& clocks);

}  // namespace versavis::client
