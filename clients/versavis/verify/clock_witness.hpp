// SPDX-License-Identifier: BSD-3-Clause
// Whether the times of an item fit what is recorded of the clocks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "verify/clock_bounds.hpp"
#include "verify/recorded_evidence.hpp"
#include "verify/verdict.hpp"

namespace versavis::client {

/// The times of one stamp: one instant on three clocks.
struct StampTimes {
    BoardTime board;
    HostTime host;
    OutputTime output;
    std::uint32_t sigma_ns;
    std::uint32_t epoch;
    std::uint32_t flags;
};

/// By how much a stamp of this sigma may be off: by chance one of 10^4 is by more.
Duration allowed_error(std::uint32_t sigma_ns);

class ClockWitness {
 public:
    ClockWitness(const ClockEvidence& evidence, const std::string& output_clock);

    /// Adds what contradicts the times, or what is missing to prove them.
    void judge(const StampTimes& stamp, VerdictBuilder& verdict) const;

    /// The same for a stamp that is not by the board's clock: it is held against the readings of
    /// the output clock alone.
    void judge_by_host_clock(const StampTimes& stamp, VerdictBuilder& verdict) const;

    /// The boot of the board that was running at `host`; null: none is recorded.
    const ClockBounds* life(BoardTime board, HostTime host) const;

    /// By how much `host` is outside what the board's messages allow for `board`; 0: nothing is
    /// known that it contradicts.
    Duration outside_bounds(BoardTime board, HostTime host) const;

    const std::vector<ClockBounds>& lives() const { return lives_; }

 private:
    void judge_host(const StampTimes& stamp, VerdictBuilder& verdict) const;
    void judge_output(const StampTimes& stamp, VerdictBuilder& verdict) const;
    std::optional<Duration> off_host_clock(const StampTimes& stamp) const;
    std::optional<Duration> off_pulses(const StampTimes& stamp) const;

    std::vector<ClockBounds> lives_;
    std::vector<OutputReading> outputs_;  ///< by epoch, then by time
    std::vector<NamedPulse> pulses_;      ///< likewise
    std::int64_t output_minus_utc_s_ = 0;
};

}  // namespace versavis::client
