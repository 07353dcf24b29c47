// SPDX-License-Identifier: BSD-3-Clause
// Lines of the libraries below Aravis go through the service's log, and not more than one can read.
#pragma once

#include <cstdint>
#include <optional>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// Lets some lines pass in each window of time, and counts the others.
class LineLimit {
 public:
    /// May this line pass?
    bool take(HostTime now) {
        if (now - began_ >= window) {
            began_ = now;
            passed_ = 0;
        }
        if (passed_ < lines) return ++passed_ > 0;
        ++suppressed_;
        return false;
    }

    /// How many did not, known once their window is over; zero: none, or not over yet.
    std::uint64_t collect(HostTime now) {
        if (now - began_ < window) return 0;
        const std::uint64_t count = suppressed_;
        suppressed_ = 0;
        return count;
    }

    static constexpr unsigned lines = 10;
    static constexpr Duration window = seconds(10);

 private:
    HostTime began_;
    unsigned passed_ = 0;
    std::uint64_t suppressed_ = 0;
};

/// GLib and what uses its log write to ours from now on. Once in a process.
void route_library_log();

/// One line for all that did not pass.
void report_suppressed_library_lines(HostTime now);

}  // namespace versavis::daemon
