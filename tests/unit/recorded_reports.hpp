// SPDX-License-Identifier: BSD-3-Clause
// What a channel of the board reports, for a test to look at.
#pragma once

#include <utility>
#include <vector>

#include "exposure_tracker.hpp"

namespace versavis::test {

struct ReportedEvent {
    wire::BoardEventKind kind;
    int source;
    firmware::Nanoseconds at;
    std::int64_t value;
    int detail;
    bool operator==(const ReportedEvent&) const = default;
};

struct RecordedReports final : firmware::ChannelReports {
    void exposure(const wire::Exposure& record) override { exposures.push_back(record); }
    void event(wire::BoardEventKind kind, std::uint8_t source, firmware::Nanoseconds at,
               std::int64_t value, std::uint16_t detail) override {
        events.push_back({kind, source, at, value, detail});
    }
    void exposure_planned(std::uint8_t /*camera*/, firmware::Nanoseconds start,
                          firmware::Nanoseconds duration) override {
        planned.emplace_back(start, duration);
    }

    std::vector<wire::Exposure> exposures;
    std::vector<ReportedEvent> events;
    std::vector<std::pair<firmware::Nanoseconds, firmware::Nanoseconds>> planned;
};

}  // namespace versavis::test
