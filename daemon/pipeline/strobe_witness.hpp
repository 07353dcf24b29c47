// SPDX-License-Identifier: BSD-3-Clause
// What the board saw of a camera that is triggered by PTP time, against what the camera says.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "engine/clock/estimate.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

struct StrobeReport {
    std::uint64_t compared = 0;
    std::uint64_t contradicting = 0;
    std::optional<Duration> error;  ///< newest start by the camera less that by the board
};

/// Starts of exposures come from both sides, in any order; each is compared with the nearest of the
/// other. Not thread-safe.
class StrobeWitness {
 public:
    /// `period`: of the camera; `line_sigma`: of the delay of its line, which is taken off.
    StrobeWitness(Duration period, Duration line_sigma)
        : period_(period), line_sigma_(line_sigma) {}

    void started(const clock::HostEstimate& by_camera) {
        take(by_camera, cameras_, boards_, false);
    }
    void rose(const clock::HostEstimate& by_board) { take(by_board, boards_, cameras_, true); }

    /// Starts in a row lay further apart than both bounds allow, lately: one of the clocks is
    /// wrong.
    bool contradicts(HostTime now) const {
        return in_a_row_ >= starts_to_contradict && now - compared_ < evidence_memory;
    }

    const StrobeReport& report() const { return report_; }

 private:
    using Starts = std::deque<clock::HostEstimate>;

    static constexpr int starts_to_contradict = 3;
    static constexpr std::size_t most_kept = 16;

    /// A line that shows nothing more is no witness. Half: slow cameras lapse between two frames.
    /// Twice: frames are withheld for as long after a line was unplugged.
    static constexpr Duration evidence_memory = seconds(10);

    void take(const clock::HostEstimate& start, Starts& own, Starts& others, bool by_board);

    Duration period_;
    Duration line_sigma_;
    Starts cameras_;
    Starts boards_;
    int in_a_row_ = 0;
    HostTime compared_;
    StrobeReport report_;
};

}  // namespace versavis::daemon
