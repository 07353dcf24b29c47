// SPDX-License-Identifier: BSD-3-Clause
#include "play/playback_clock.hpp"

#include <algorithm>

namespace versavis::client {

namespace {

/// Streams lie in the file within a second of one another, and pauses of a service that restarts
/// last some seconds. If lower, such a pause would be skipped; if higher, a jump back is waited
/// for.
constexpr Duration longest_step = seconds(10);

}  // namespace

HostTime PlaybackClock::due(OutputTime stamp, HostTime now) {
    if (!anchor_ || absolute(stamp - newest_) > longest_step) {
        anchor_ = stamp;
        anchored_ = now;
        newest_ = stamp;
    }
    newest_ = std::max(newest_, stamp);
    return at(stamp);
}

HostTime PlaybackClock::due_beside(OutputTime stamp, HostTime now) const {
    const bool beside = anchor_ && stamp >= *anchor_ && absolute(stamp - newest_) <= longest_step;
    return beside ? at(stamp) : now;
}

HostTime PlaybackClock::at(OutputTime stamp) const {
    const auto since = static_cast<double>((stamp - *anchor_).ns) / rate_;
    return anchored_ + Duration{static_cast<std::int64_t>(since)};
}

}  // namespace versavis::client
