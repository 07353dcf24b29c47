// SPDX-License-Identifier: BSD-3-Clause
// Keeps the grid of the board's triggers on the whole seconds of the output clock.
#pragma once

#include <deque>
#include <mutex>
#include <optional>

#include "engine/clock/translator.hpp"
#include "output_pace.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

struct GridReport {
    bool aligned =
        false;  ///< the board is updated once a second, and its exposures lie where they should
    Duration error;  ///< of the grid, by the middles of recent exposures; 0: there were none
};

/// Thread-safe.
class GridAlignment {
 public:
    GridAlignment(const ClockConfiguration& clock, const wire::Configuration& board);

    bool wanted() const { return wanted_; }

    /// A new connection: the board is to be updated at once.
    void begin();

    /// The board has this configuration from now on.
    void reconfigure(const wire::Configuration& board);

    /// What to send to the board now. None: it was updated within the last second, or the clock is
    /// not known well enough.
    std::optional<wire::AlignGrid> message(HostTime now, clock::Translator& translator);

    /// An exposure, and when its middle was.
    void exposure(const wire::Exposure& record, OutputTime middle, HostTime now);

    GridReport report(HostTime now) const;

 private:
    struct Error {
        HostTime at;
        Duration error;
    };

    bool wanted_;
    std::uint32_t max_slew_ppb_;
    wire::Configuration board_;
    mutable std::mutex mutex_;
    HostTime next_;
    std::optional<HostTime> updated_;
    OutputPace pace_;
    std::deque<Error> errors_;
};

}  // namespace versavis::daemon
