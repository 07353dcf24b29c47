// SPDX-License-Identifier: BSD-3-Clause
// By how much the end of an exposure shows later on its line than the start, learned against the
// camera's own exposure time: what it says of line and load, and what it takes off the stamps.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "engine/plausibility/running_estimate.hpp"
#include "settings/line_delays.hpp"

namespace versavis::daemon {

struct EdgeReport {
    std::string line;
    std::size_t frames = 0;   ///< that were measured; 0: nothing is known
    Duration difference;      ///< delay of the end less that of the start
    Duration sigma;           ///< of that, one standard deviation
    Duration expected;        ///< by preset or configuration
    Duration expected_sigma;  ///< of that
    Duration correction;      ///< of the middle of each exposure, beyond what is expected
};

/// What is taken off the edges of an exposure beyond the known delays of its line.
struct EdgeCorrection {
    Duration start;
    Duration end;
    Duration sigma;  ///< of the middle: one standard deviation

    Duration middle() const { return (start + end) / 2; }
};

/// A surplus is what an exposure lasts longer by its line, known delays taken off, than by the
/// camera's account. Not thread-safe.
class EdgeDifference {
 public:
    EdgeDifference() { set_line_delays({}); }

    /// Of the exposures to come; what was measured before is void.
    void set_line_delays(const LineDelays& lines);

    /// A frame's surplus; `start_delay`: from the board's trigger to the start, as the board saw
    /// it.
    void learn(Duration surplus, Duration start_delay);

    /// True when the line explains it: an honest exposure may have it.
    bool explains(Duration surplus) const {
        return absolute(surplus - surplus_.value()) <= tolerance();
    }

    /// What the line adds to each exposure, and how far off an honest one may be.
    Duration surplus() const { return surplus_.value(); }
    Duration tolerance() const { return std::min(surplus_.tolerance(), insignificant()); }

    /// Enough frames agree on it.
    bool settled() const { return agreed_ >= frames_to_learn; }

    EdgeCorrection correction() const;
    EdgeReport report() const;

 private:
    /// Frames in a row, none of which is explained, that agree on another difference.
    static constexpr unsigned frames_to_learn = 8;

    Duration insignificant() const;
    void dispute(Duration surplus, Duration start_delay);

    EdgeReport report_;
    std::array<std::int64_t, 32> surplus_ns_{};  ///< the newest, in no order
    std::size_t next_ = 0;
    RunningEstimate surplus_{Duration{}};
    RunningEstimate rival_{Duration{}};
    unsigned agreed_ = 0;  ///< frames that were explained
    unsigned rivals_ = 0;  ///< frames in a row that were not, but agree with each other
    bool corrected_ = false;
};

/// What is wrong with the exposure line, and what to do; empty: nothing that shows.
std::string line_hint(const EdgeReport& edges);

}  // namespace versavis::daemon
