// SPDX-License-Identifier: BSD-3-Clause
// The offset between pictures and gyro, one after the other in time.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "base/picture_offset.hpp"
#include "evaluate/imu_evaluation.hpp"

namespace versavis::client {

/// What a stretch of time shows.
struct StretchComparison {
    OutputTime from;
    OutputTime to;
    Expected<PictureOffset> offset;  ///< error: why the motion shows none
};

/// Compares the rotations between the frames of one camera with a gyro, stretch by stretch, while
/// both go on; holds no more than it needs for one. Used by one thread.
class PictureComparison {
 public:
    explicit PictureComparison(Duration stretch) : stretch_(stretch) {}

    /// In the order of time each; the gyro may be ahead.
    void add(const GyroSample& sample);
    void add(const FrameRotation& rotation);

    /// The next stretch that is complete; call it after each addition.
    std::optional<StretchComparison> take();

    /// The last one, after the last addition.
    std::optional<StretchComparison> finish();

    /// The stamps of what follows do not continue those before.
    void restart();

 private:
    StretchComparison compare();

    Duration stretch_;
    std::vector<FrameRotation> rotations_;  ///< of the stretch
    std::vector<FrameRotation> next_;       ///< after it
    std::deque<GyroSample> gyro_;
};

/// In each stretch of 20 s whose motion shows it.
std::vector<PictureOffset> picture_offsets(const SeenMotion& motion);

/// Of one camera of a recording.
PictureEvidence compare_pictures(const Recording& recording, const ImuEvaluationSettings& settings);

}  // namespace versavis::client
