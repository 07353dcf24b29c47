// SPDX-License-Identifier: BSD-3-Clause
// Recomputes the stamps of a recording from a clock that uses earlier and later messages.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/clock/smoother.hpp"
#include "evaluate/clock_evaluation.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Gives the smoothed stamp for a board time of any of the recorded boots. Read-only after
/// construction.
class Restamping {
 public:
    /// `asymmetry`: of the link, if it was measured, as it was subtracted live.
    Restamping(const RecordedClocks& clocks, const std::optional<clock::Asymmetry>& asymmetry);

    struct Stamp {
        HostTime host;
        OutputTime output;
        Duration sigma;  ///< of the clock alone
    };

    /// `about`: the host time within two seconds; it selects the board's boot. None: no messages
    /// around it, or the output clock is not known there.
    std::optional<Stamp> stamp(BoardTime board, HostTime about) const;

    /// Output time of an instant on the host clock.
    std::optional<OutputTime> output(HostTime host) const;

    /// Of the stamps that were made with the output clock as it was read before `host`.
    std::optional<std::uint32_t> epoch(HostTime host) const;

    /// The most that a stamp of the service, which read the output clock by itself, is off from it.
    Duration reading_error(HostTime host) const;

    /// Sigma of the estimate that the service would have had of these messages alone. One that knew
    /// earlier ones was surer at the beginning, and may have been as sure as it ever becomes.
    struct Replayed {
        Duration then;
        Duration least;
    };
    std::optional<Replayed> live_sigma(HostTime host) const;

 private:
    std::vector<clock::Smoother> smoothers_;
    std::vector<clock::RecordedOutput> outputs_;
    struct DatedSigma {
        HostTime at;
        Duration sigma;
    };
    std::vector<DatedSigma> live_sigmas_;  ///< after each exchange, by time
    Duration least_live_sigma_;
};

}  // namespace versavis::client
