// SPDX-License-Identifier: BSD-3-Clause
// The clock of an emulated camera, and its PTP port: free, or after a master.
#pragma once

#include <cstdint>
#include <mutex>

#include "skewed_clock.hpp"

namespace versavis::rig {

/// The clock that the network's PTP master has, and the others follow.
struct PtpScenario {
    double ahead_of_utc_s = 37;  ///< TAI, as PTP wants it
    double skew_ppm = 0;
};

/// As GenICam numbers them.
enum class PtpPort : std::uint32_t {
    disabled = 2,
    listening = 3,
    master = 5,
    uncalibrated = 7,
    slave = 8
};

/// A follower is off its master by a constant and a slow swing, as servos are. Thread-safe.
class PtpFollower {
 public:
    struct Settings {
        ClockErrors clock;   ///< without PTP
        Duration lock_time;  ///< from the first message of a master until it follows
        std::int64_t error_ns = 0;
        std::int64_t swing_ns = 0;
    };
    PtpFollower(HostTime zero, const PtpScenario& network, const Settings& settings);

    void enable(bool enabled, HostTime now);

    /// For so long it hears no master: it drifts from where it is.
    void lose_master(HostTime now, Duration duration);
    /// It says that it is one itself.
    void become_master(HostTime now, Duration duration);
    /// It follows another master, whose time is off by so much.
    void follow_another(HostTime now, Duration off, Duration duration);
    /// From now on, on top of all.
    void jump(Duration by);

    PtpPort port(HostTime now) const;
    std::int64_t offset_ns(HostTime at) const;  ///< of its own account, from its master
    std::int64_t device_ns(HostTime at) const;
    HostTime host(std::int64_t device_ns) const;  ///< inverse of it, within 1 ns

 private:
    enum class State { free, following, alone };

    bool follows(HostTime at) const;
    std::int64_t shown(HostTime at) const;
    void leave(HostTime now, Duration duration);

    const HostTime zero_;
    const SkewedClock own_;
    const SkewedClock master_;
    const Settings settings_;
    mutable std::mutex mutex_;
    bool enabled_ = false;
    bool claims_to_be_master_ = false;
    HostTime follows_from_;
    HostTime alone_from_;              ///< until it follows again, the own clock goes on from here
    std::int64_t alone_ahead_ns_ = 0;  ///< of the own clock
    HostTime other_until_;
    std::int64_t other_off_ns_ = 0;
    std::int64_t jumped_ns_ = 0;
};

}  // namespace versavis::rig
