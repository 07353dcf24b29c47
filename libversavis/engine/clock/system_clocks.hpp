// SPDX-License-Identifier: BSD-3-Clause
// The clocks of this machine, and what its kernel reports about them; tests replace them by
// simulated ones.
#pragma once

#include <cstdint>
#include <memory>

#include "versavis/time.hpp"

namespace versavis::clock {

enum class SystemClock { monotonic_raw, monotonic, boottime, realtime, tai };

/// How well CLOCK_REALTIME is disciplined, by NTP, PTP or GNSS.
struct KernelState {
    bool synchronised = false;
    Duration max_error;             ///< of CLOCK_REALTIME
    std::int32_t tai_offset_s = 0;  ///< TAI minus UTC; 0: never set in the kernel
    int leap_s = 0;                 ///< that UTC gains at the end of its day, or loses: 1, -1
    int error = 0;                  ///< why only the offset can be read, as errno; 0: all can
};

/// Thread-safe.
class SystemClocks {
 public:
    virtual ~SystemClocks() = default;

    virtual std::int64_t read_ns(SystemClock clock) = 0;
    virtual KernelState kernel_state() = 0;

    /// How often CLOCK_REALTIME was set (by a person, a daemon, a leap second or the end of a
    /// suspend) since this object was made, as far as this call shows. A system call: some ten
    /// times as expensive as read_ns().
    virtual std::uint32_t times_set() = 0;
};

/// Those of the kernel.
std::shared_ptr<SystemClocks> kernel_clocks();

}  // namespace versavis::clock
