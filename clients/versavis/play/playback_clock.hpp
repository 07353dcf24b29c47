// SPDX-License-Identifier: BSD-3-Clause
// When an item of a recording is due for publication.
#pragma once

#include <optional>

#include "versavis/time.hpp"

namespace versavis::client {

class PlaybackClock {
 public:
    explicit PlaybackClock(double rate) : rate_(rate) {}

    /// When the item of this stamp is due, asked at `now`. Stamps that jump, because the output
    /// clock was set or the recorder's machine slept, cause no wait: the next item is due at once.
    HostTime due(OutputTime stamp, HostTime now);

    /// The same for one that others set the pace of: `now` if it is older than the first of them,
    /// or far from the newest.
    HostTime due_beside(OutputTime stamp, HostTime now) const;

 private:
    HostTime at(OutputTime stamp) const;

    double rate_;
    std::optional<OutputTime> anchor_;
    HostTime anchored_;
    OutputTime newest_;
};

}  // namespace versavis::client
