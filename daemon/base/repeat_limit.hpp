// SPDX-License-Identifier: BSD-3-Clause
// Keeps lines that repeat from flooding the log.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class RepeatLimit {
 public:
    /// The line as it should be logged; none: it was, often enough.
    std::optional<std::string> pass(const std::string& line, HostTime now) {
        std::erase_if(seen_,
                      [now](const auto& entry) { return now - entry.second.first > memory; });
        Seen& seen = seen_.try_emplace(line, Seen{now, 0}).first->second;
        if (++seen.times > most) return std::nullopt;
        return seen.times < most ? line : line + " (repeats within a minute are not logged)";
    }

    static constexpr Duration memory = seconds(60);
    static constexpr int most = 3;

 private:
    struct Seen {
        HostTime first;
        int times = 0;
    };

    std::map<std::string, Seen> seen_;
};

}  // namespace versavis::daemon
