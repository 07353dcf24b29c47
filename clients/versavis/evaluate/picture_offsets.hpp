// SPDX-License-Identifier: BSD-3-Clause
// The offset between pictures and gyro, one after the other in time.
#pragma once

#include "base/picture_offset.hpp"
#include "evaluate/imu_evaluation.hpp"

namespace versavis::client {

/// In each stretch of 20 s whose motion shows it.
std::vector<PictureOffset> picture_offsets(const SeenMotion& motion);

/// Of one camera of a recording.
PictureEvidence compare_pictures(const Recording& recording, const ImuEvaluationSettings& settings);

}  // namespace versavis::client
