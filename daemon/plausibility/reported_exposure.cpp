// SPDX-License-Identifier: BSD-3-Clause
#include "reported_exposure.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// Both; unknown with anything is unknown.
std::optional<LengthRange> joined(const std::optional<LengthRange>& a,
                                  const std::optional<LengthRange>& b) {
    if (!a || !b) return std::nullopt;
    return LengthRange{std::min(a->shortest, b->shortest), std::max(a->longest, b->longest)};
}

}  // namespace

void ReportedExposure::add(Duration exposure, HostTime at) {
    const auto range =
        exposure.ns == 0 ? std::nullopt : std::optional(LengthRange{exposure, exposure});
    reports_.push_back({range, at});
    // Frames that are asked about exposed within `settling_` before the newest report.
    while (reports_.size() > 1 && reports_[1].since + settling_ * 2 < at) reports_.pop_front();
    if (reports_.size() <= most_reports) return;
    reports_[1] = {joined(reports_[0].range, reports_[1].range), reports_[0].since};
    reports_.pop_front();
}

std::optional<LengthRange> ReportedExposure::at(HostTime instant) const {
    auto range = reports_.back().range;
    for (std::size_t i = 0; i + 1 < reports_.size(); ++i)
        if (instant <= reports_[i + 1].since + settling_) range = joined(range, reports_[i].range);
    return range;
}

}  // namespace versavis::daemon
