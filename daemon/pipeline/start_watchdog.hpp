// SPDX-License-Identifier: BSD-3-Clause
// Whether the board sends the triggers that it was asked for, and the camera answers them.
#pragma once

#include <cstdint>

#include "settings/configuration.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class StartWatchdog {
 public:
    explicit StartWatchdog(const CameraConfiguration& configuration) { expect(configuration); }

    void expect(const CameraConfiguration& configuration) {
        patience_ = start_patience + period_of(configuration) * patient_periods;
    }

    void asked(HostTime now) { last_ = now; }
    void recorded(std::uint64_t trigger, HostTime now) {
        newest_ = trigger;
        last_ = now;
        ++unanswered_;
    }
    void answered() { unanswered_ = 0; }

    /// No trigger came for so long that the board should be asked again.
    bool overdue(HostTime now) const { return now - last_ > patience_; }
    std::uint64_t newest() const { return newest_; }
    std::uint64_t unanswered() const { return unanswered_; }

 private:
    /// How long the board may take to begin, and the periods on top for slow cameras.
    static constexpr Duration start_patience = seconds(2);
    static constexpr int patient_periods = 5;

    Duration patience_;
    HostTime last_;
    std::uint64_t newest_ = 0;
    std::uint64_t unanswered_ = 0;
};

}  // namespace versavis::daemon
