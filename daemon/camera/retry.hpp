// SPDX-License-Identifier: BSD-3-Clause
// When a camera is tried again: what may end at any moment soon, what somebody has to mend later
// and later.
#pragma once

#include <algorithm>

#include "camera/camera_state.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

class Retry {
 public:
    /// How long to wait after an attempt that ended like this.
    Duration after(CameraState why) {
        if (why != CameraState::misconfigured && why != CameraState::failed) {
            longer_ = first;
            const bool was_there = why == CameraState::opening || why == CameraState::silent;
            return was_there ? Duration{} : soon;
        }
        const Duration now = longer_;
        longer_ = std::min(longer_ * 2, longest);
        return now;
    }

    /// It was gone and is back: what was wrong with it may be mended.
    void begin_anew() { longer_ = first; }

    /// At half, an absent camera is asked more often; at twice, one that boots is back 0.1 s later.
    static constexpr Duration soon = milliseconds(100);

    /// At half, a misconfigured camera is opened anew more often; at twice, one that was mended
    /// is seen half a second later.
    static constexpr Duration first = milliseconds(500);

    /// At half, a camera that cannot be used is bothered twice as often; at twice, one that was
    /// mended without being switched off is seen ten seconds later.
    static constexpr Duration longest = seconds(10);

 private:
    Duration longer_ = first;
};

}  // namespace versavis::daemon
