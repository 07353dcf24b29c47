// SPDX-License-Identifier: BSD-3-Clause
// The clocks of all cameras that follow PTP: what they say of themselves, what they show, and the
// stamps that follow.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/clock/ptp_timescale.hpp"
#include "engine/clock/translator.hpp"

namespace versavis::daemon {

/// What a camera says of its PTP port.
struct PtpStatus {
    std::string state;               ///< as IEEE 1588 names them: "Slave", "Master", ...
    bool servo_locked = true;        ///< false: it follows a master, but not closely yet
    std::optional<Duration> offset;  ///< from its master
    std::string grandmaster;         ///< its identity, in hexadecimal; empty: it does not say

    bool follows() const { return state == "Slave" && servo_locked; }
    bool is_master() const { return state == "Master"; }
};

/// One camera's clock.
struct PtpClockReport {
    std::string name;
    PtpStatus status;
    clock::Agreement agreement = clock::Agreement::unknown;  ///< of the newest that could tell
    std::uint64_t readings = 0;
    std::uint64_t differing = 0;
    Duration width;             ///< of the newest reading
    bool contradicted = false;  ///< by the board
};

/// PTP's time as all readings have it.
struct PtpReport {
    clock::ClockState state = clock::ClockState::init;
    Duration sigma;
    Duration bound;
    std::uint64_t steps = 0;
    std::string master;        ///< a camera that is one, and should not; empty: none
    std::string contradicted;  ///< a camera whose exposures the board saw elsewhere; empty: none
    /// PTP's time less UTC of this host: 37 s for TAI, as PTP wants it; none: not known yet.
    std::optional<Duration> minus_utc;
    std::vector<PtpClockReport> clocks;
};

/// Thread-safe: cameras' threads read clocks, any thread translates.
class PtpClocks {
 public:
    explicit PtpClocks(clock::Translator& translator) : translator_(translator) {}

    /// Returns its number.
    std::size_t add(const std::string& name);

    /// What a camera says of itself; nothing: it is gone.
    void note(std::size_t clock, const PtpStatus& status);

    /// Returns `differs`, too, while the camera does not follow PTP.
    clock::Agreement read(std::size_t clock, const clock::ClockReading& reading);

    /// The board saw this camera's exposures elsewhere than its clock says. Then PTP's time or the
    /// board's is wrong, and so may be the stamps of all cameras.
    void contradict(std::size_t clock, bool contradicted);

    /// No stamp of any camera can be trusted: the board contradicts one that follows, or one is a
    /// master.
    bool distrusted() const;

    /// Times that PTP's time stepped for all.
    std::uint64_t steps() const;

    /// It can be triggered: it follows PTP and shows its time, and no camera is a master.
    bool ready(std::size_t clock) const;

    std::optional<clock::HostEstimate> to_host(CameraTime ptp) const;
    std::optional<CameraTime> at(HostTime host) const;

    /// None: PTP's time is not known.
    std::optional<clock::Stamp> translate(CameraTime ptp);

    PtpReport report();

 private:
    std::string master() const;
    std::string contradicted() const;

    clock::Translator& translator_;
    mutable std::mutex mutex_;
    clock::PtpTimescale timescale_;
    std::vector<PtpClockReport> clocks_;
};

}  // namespace versavis::daemon
