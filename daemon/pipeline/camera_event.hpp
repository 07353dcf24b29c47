// SPDX-License-Identifier: BSD-3-Clause
// What a camera reports of itself, beside its frames.
#pragma once

#include <cstdint>

#include "versavis/time.hpp"

namespace versavis::daemon {

enum class CameraEventKind { exposure_start, exposure_end, trigger_missed, ptp_lost, ptp_locked };

struct CameraEvent {
    CameraEventKind kind = CameraEventKind::trigger_missed;
    std::uint64_t block_id = 0;  ///< as the camera counts; 0: it does not say
    CameraTime at;
};

}  // namespace versavis::daemon
