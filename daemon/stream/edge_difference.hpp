// SPDX-License-Identifier: BSD-3-Clause
// By how much the end of an exposure shows later on its line than the start, measured against the
// camera's own exposure time, and what it says of line and load.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "camera/line_delays.hpp"
#include "engine/pairing/evidence.hpp"

namespace versavis::daemon {

struct EdgeReport {
    std::string line;
    std::size_t frames = 0;   ///< that were measured; 0: nothing is known
    Duration difference;      ///< delay of the end less that of the start
    Duration sigma;           ///< of that, one standard deviation
    Duration expected;        ///< by preset or configuration
    Duration expected_sigma;  ///< of that
};

/// Not thread-safe.
class EdgeDifference {
 public:
    /// Of the exposures to come; what was measured before is void.
    void set_line_delays(const LineDelays& lines);

    /// A frame's exposure, and how long it was by the camera's account; 0: unknown.
    void paired(const pairing::Exposure& exposure, Duration told);

    EdgeReport report() const;

 private:
    EdgeReport report_;
    /// Measured length, corrected, less the camera's account: the newest, in no order.
    std::array<std::int64_t, 32> surplus_ns_{};
    std::size_t next_ = 0;
};

/// What is wrong with the exposure line, and what to do; empty: nothing that shows.
std::string line_hint(const EdgeReport& edges);

}  // namespace versavis::daemon
