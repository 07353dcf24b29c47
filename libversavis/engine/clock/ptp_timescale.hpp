// SPDX-License-Identifier: BSD-3-Clause
// The time that PTP distributes, against the host's clock: from reads of clocks that follow it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/estimate.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// The clock of a camera that follows PTP showed `shown` at some instant of this span.
struct ClockReading {
    HostTime before;
    CameraTime shown;
    HostTime after;

    Duration width() const { return after - before; }
};

/// Of a reading with what all readings say together.
enum class Agreement {
    unknown,  ///< nothing is known yet, or the reading is too wide to tell
    agrees,
    differs,  ///< the clock shows another time
};

/// All clocks that follow one master are one clock, so their readings steer one estimate, each as
/// an exchange of messages whose two stamps of the far side are one. A clock that contradicts it
/// while another agrees is the one that is wrong; where none agrees, PTP's own time stepped, and
/// the estimate begins anew. Not thread-safe.
class PtpTimescale {
 public:
    /// A clock that will be read. Returns its number.
    std::size_t add_clock();

    Agreement add(std::size_t clock, const ClockReading& reading);

    /// It does not follow PTP any more, or is not read any more: it is no witness.
    void forget(std::size_t clock);

    /// None before two readings agree, and of what cannot be a time of PTP.
    std::optional<HostEstimate> to_host(CameraTime ptp) const;

    /// What PTP's clocks show then; the same.
    std::optional<CameraTime> at(HostTime host) const;

    /// Times that an estimate that held was given up: stamps before and after do not compare.
    std::uint64_t steps() const { return steps_; }

    /// A reading that took longer proves nothing. Half: busy hosts prove less often. Twice: clocks
    /// may be off by twice as much before that shows.
    static constexpr Duration widest_reading = milliseconds(2);

 private:
    bool confirmed_by_another(std::size_t clock, HostTime now) const;
    bool leads(std::size_t clock, HostTime now);

    EnvelopeFilter filter_;
    std::vector<std::optional<HostTime>> agreed_;  ///< by clock: when it did last
    std::optional<std::size_t> leader_;            ///< the clock that a new estimate begins with
    HostTime leader_read_;
    std::uint64_t steps_ = 0;
};

}  // namespace versavis::clock
