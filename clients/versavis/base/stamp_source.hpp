// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "versavis/metadata.hpp"

namespace versavis::client {

/// The board saw the exposure, or triggered it: its time is the stamp.
inline bool stamped_by_board(const FrameMetadata& frame) {
    return frame.stamp_kind() != StampKind::arrival && frame.stamp_kind() != StampKind::camera_ptp;
}

}  // namespace versavis::client
