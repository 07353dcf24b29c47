// SPDX-License-Identifier: BSD-3-Clause
#include "health/lidar_reports.hpp"

#include <algorithm>
#include <utility>

namespace versavis::daemon {

namespace {

/// If lower, a busy host that skips a report calls a LiDAR unproved; if higher, one that fell
/// silent seems to follow.
constexpr Duration validity = seconds(30);

constexpr std::size_t most_lidars = 32;

}  // namespace

bool LidarReports::add(const std::vector<LidarReport>& reports, HostTime now) {
    std::map<std::string, Entry> entries = entries_;
    for (const LidarReport& report : reports) entries[report.source] = {report, now};
    // Those that nobody reports any more make room.
    while (entries.size() > most_lidars) {
        const auto oldest = std::min_element(
            entries.begin(), entries.end(),
            [](const auto& a, const auto& b) { return a.second.at < b.second.at; });
        if (now - oldest->second.at <= validity) return false;
        entries.erase(oldest);
    }
    entries_ = std::move(entries);
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
