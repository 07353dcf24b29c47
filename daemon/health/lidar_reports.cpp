// SPDX-License-Identifier: BSD-3-Clause
#include "health/lidar_reports.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// If lower, a busy host that skips a report calls a LiDAR unproved; if higher, one that fell
/// silent seems to follow.
constexpr Duration validity = seconds(30);

constexpr std::size_t most_lidars = 32;

}  // namespace

bool LidarReports::add(const std::vector<LidarReport>& reports, HostTime now) {
    const auto added = std::count_if(
        reports.begin(), reports.end(),
        [&](const LidarReport& report) { return entries_.count(report.source) == 0; });
    if (entries_.size() + static_cast<std::size_t>(added) > most_lidars) return false;
    for (const LidarReport& report : reports) entries_[report.source] = {report, now};
    return true;
}

std::vector<LidarReport> LidarReports::report(HostTime now) const {
    std::vector<LidarReport> all;
    for (const auto& [source, entry] : entries_) {
        all.push_back(entry.report);
        if (now - entry.at <= validity) continue;
        all.back() = {source,
                      entry.report.maker,
                      lidar_unproved,
                      "no packet of it was seen for 30 s: check its power and cable, and whether "
                      "'versavis lidar watch' runs",
                      std::nullopt,
                      std::nullopt};
    }
    return all;
}

}  // namespace versavis::daemon
