// SPDX-License-Identifier: BSD-3-Clause
// Whether LiDARs follow, as those report it who watch their packets.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// What `versavis lidar watch` found; the words are its own.
struct LidarReport {
    std::string source;   ///< address and interface, as "192.168.1.3%eth1"
    std::string maker;    ///< as "Livox"
    std::string verdict;  ///< one of lidar_verdicts
    std::string hint;
    std::optional<Duration> behind;  ///< the host's time, at most
    std::optional<Duration> ahead;
};

inline constexpr const char* lidar_follows = "follows";
inline constexpr const char* lidar_unproved = "unproved";
inline constexpr const char* lidar_verdicts[] = {lidar_follows, "unlocked", "unset",
                                                 "off",         "drifts",   lidar_unproved};

/// The newest report of each LiDAR. Not thread-safe.
class LidarReports {
 public:
    /// False: these are more LiDARs at once than a vehicle has, and none is taken.
    bool add(const std::vector<LidarReport>& reports, HostTime now);

    /// By address. One of which nobody reports any more is unproved.
    std::vector<LidarReport> report(HostTime now) const;

 private:
    struct Entry {
        LidarReport report;
        HostTime at;
    };

    std::map<std::string, Entry> entries_;
};

}  // namespace versavis::daemon
