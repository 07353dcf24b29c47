// SPDX-License-Identifier: BSD-3-Clause
// How long a camera may be exposing at some instant, by what it was set to and what was read from
// it.
#pragma once

#include <deque>
#include <optional>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// The exposure is one of these lengths.
struct LengthRange {
    Duration shortest;
    Duration longest;

    Duration width() const { return longest - shortest; }
};

/// Not thread-safe. Nothing is known before the first report.
class ReportedExposure {
 public:
    /// `settling`: a camera may expose as before for so long after a report.
    explicit ReportedExposure(Duration settling) : settling_(settling) {}

    /// Set or read at that time, not before any earlier one; 0: unknown from then on.
    void add(Duration exposure, HostTime at);

    void clear() { reports_.assign(1, Report{}); }

    /// What the camera may have exposed then; none: unknown.
    std::optional<LengthRange> at(HostTime instant) const;

 private:
    struct Report {
        std::optional<LengthRange> range;
        HostTime since;
    };

    /// More reports than a camera takes exposures during `settling`, but for the fastest: the range
    /// of the oldest two becomes one, which is safe, and wider.
    static constexpr std::size_t most_reports = 64;

    Duration settling_;
    std::deque<Report> reports_{Report{}};  ///< by time; the first: nothing was known
};

}  // namespace versavis::daemon
