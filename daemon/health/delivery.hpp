// SPDX-License-Identifier: BSD-3-Clause
// Whether a stream delivers what it is configured to: good items against the rate, over a few
// seconds.
#pragma once

#include <cstdint>
#include <deque>

#include "versavis/time.hpp"

namespace versavis::daemon {

struct DeliveryReport {
    bool full = false;        ///< it keeps to its rate
    bool ever = false;        ///< it did so once
    bool fell_short = false;  ///< since it began, after it had been full
    HostTime began;           ///< when it was last started
    double rate_hz = 0;       ///< of good items, lately
};

/// Times only enter through the arguments. Not thread-safe.
class Delivery {
 public:
    explicit Delivery(double rate_hz) : rate_hz_(rate_hz) {}

    /// It is started, or started anew: nothing is full until it delivers. One that delivered
    /// nothing since the start before is still in that one.
    void begin(HostTime now);

    /// `items`: good ones, ever. Call it about twice a second.
    void count(std::uint64_t items, HostTime now);

    const DeliveryReport& report() const { return report_; }

 private:
    struct Count {
        HostTime at;
        std::uint64_t items = 0;
    };

    const Count& before(Duration window) const;
    bool covers(Duration window) const;
    double missing(Duration window) const;
    Duration at_least(Duration window, int periods) const;

    double rate_hz_;
    std::deque<Count> counts_;  ///< oldest first
    bool delivered_ = true;     ///< anything since it began
    DeliveryReport report_;
};

}  // namespace versavis::daemon
