// SPDX-License-Identifier: BSD-3-Clause
// Whether the pictures of a camera and its stamps belong together, by the rotation that both the
// pictures and the gyro show.
#pragma once

#include <optional>
#include <vector>

#include "base/picture_offset.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Less is what a moving camera and near things may do to an offset.
constexpr Duration least_departure = microseconds(500);

/// Kalibr's own offset is hardly known better.
constexpr Duration least_miscalibration = milliseconds(1);

class PictureJudge {
 public:
    /// What a shutter and a filter delay is the same throughout: an offset counts that differs from
    /// the others, or if all differ from the calibration.
    explicit PictureJudge(const PictureEvidence& evidence);

    /// By how much pictures and stamps differ there; none: they do not, or nothing shows it.
    std::optional<Duration> off(OutputTime at) const;

    /// Of all; none: there are too few.
    const std::optional<PictureOffset>& usual() const { return usual_; }

 private:
    const PictureEvidence& evidence_;
    std::optional<PictureOffset> usual_;
    Duration by_calibration_;  ///< all are off by this; 0: they are not
};

}  // namespace versavis::client
