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
    /// `asymmetry`: of the link, as it was subtracted live.
    Restamping(const RecordedClocks& clocks, Duration asymmetry);

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

 private:
    std::vector<clock::Smoother> smoothers_;
    std::vector<clock::RecordedOutput> outputs_;
    Duration asymmetry_;
};

}  // namespace versavis::client
