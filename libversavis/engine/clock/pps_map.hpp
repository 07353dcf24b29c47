// SPDX-License-Identifier: BSD-3-Clause
// Board time to output time from pulses once a second whose seconds are known: no link takes part.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/clock/gaussian_state.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

struct OutputEstimate {
    OutputTime time;
    Duration sigma;
};

/// Kalman filter on offset, skew and drift; a pulse that does not fit is left out and counted, and
/// three in a row restart it. A pure function of pulses and labels.
class PpsMap {
 public:
    /// The board saw the pulse of this second at `at`. Pulses come in order.
    void add(BoardTime at, OutputTime second);

    /// None before the fourth pulse, nor when the newest is more than `longest_holdover` older than
    /// `board`.
    std::optional<OutputEstimate> translate(BoardTime board) const;

    void board_restarted() { *this = {}; }

    /// True: pulses come, and they agree.
    bool healthy(BoardTime now) const;

    std::uint64_t pulses() const { return pulses_; }
    std::uint64_t rejected() const { return rejected_; }
    Duration last_residual() const { return last_residual_; }

    static constexpr Duration longest_holdover = seconds(60);

 private:
    void begin(BoardTime at, OutputTime second);
    bool agrees(double residual_ns, double variance) const;

    GaussianState state_;
    BoardTime reference_;
    Duration base_;  ///< output minus board time that the offset counts from
    std::uint64_t in_row_ = 0;
    int misfits_in_row_ = 0;
    std::uint64_t pulses_ = 0;
    std::uint64_t rejected_ = 0;
    Duration last_residual_;
};

}  // namespace versavis::clock
