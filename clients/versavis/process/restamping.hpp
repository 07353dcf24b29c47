// SPDX-License-Identifier: BSD-3-Clause
// Stamps of a recording made anew: the clock by all messages, earlier and later ones.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/clock/smoother.hpp"
#include "evaluate/clock_evaluation.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

class Restamping {
 public:
    /// `asymmetry`: of the link, as it was taken off live.
    Restamping(const RecordedClocks& clocks, Duration asymmetry);

    struct Stamp {
        HostTime host;
        OutputTime output;
        Duration sigma;  ///< of the clock alone
    };

    /// `about`: when it was, on the host clock, within two seconds; it tells which of the board's
    /// lives is meant. None: no messages around it, or the output clock is not known there.
    std::optional<Stamp> stamp(BoardTime board, HostTime about) const;

    /// Output time of an instant on the host clock.
    std::optional<OutputTime> output(HostTime host) const;

 private:
    std::vector<clock::Smoother> smoothers_;
    std::vector<clock::RecordedOutput> outputs_;
    Duration asymmetry_;
};

}  // namespace versavis::client
