// SPDX-License-Identifier: BSD-3-Clause
// Which changes of the health are worth a line of the log, and of what level.
#pragma once

#include <optional>
#include <string>

#include "base/log.hpp"
#include "status.hpp"

namespace versavis::daemon {

inline LogLevel severity(const Summary& summary) {
    if (summary.health != Health::degraded) return LogLevel::info;
    return summary.dead ? LogLevel::error : LogLevel::warning;
}

/// Not thread-safe.
class HealthLog {
 public:
    /// The level of a line about it; none: that was logged. A change of health is logged at once, a
    /// change of cause or level when it has lasted: causes may take turns. One that is only worded
    /// anew, such as by a time, is not logged again.
    std::optional<LogLevel> see(const Summary& summary, HostTime now) {
        const Seen seen{summary.health, severity(summary), summary.cause};
        if (seen != newest_) since_ = now;
        newest_ = seen;
        const bool too_young = seen.health == logged_.health && now - since_ < patience;
        if (seen == logged_ || too_young) return std::nullopt;
        logged_ = seen;
        return seen.level;
    }

    static constexpr Duration patience = seconds(2);

 private:
    struct Seen {
        Health health = Health::starting;
        LogLevel level = LogLevel::info;
        std::string cause;

        bool operator==(const Seen&) const = default;
    };

    Seen newest_;
    Seen logged_;
    HostTime since_;
};

}  // namespace versavis::daemon
