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
    void restart() { longer_ = first; }

    static constexpr Duration soon = milliseconds(100);

    static constexpr Duration first = milliseconds(500);

    static constexpr Duration longest = seconds(10);

 private:
    Duration longer_ = first;
};

}  // namespace versavis::daemon
