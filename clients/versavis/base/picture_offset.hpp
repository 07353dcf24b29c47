// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

/// By how much the stamps of an IMU are later than those of pictures that show the same rotation,
/// between two instants of the output clock.
struct PictureOffset {
    OutputTime from;
    OutputTime to;
    Duration offset;
    Duration sigma;
};

/// The pictures of one camera.
struct PictureEvidence {
    std::vector<PictureOffset> offsets;  ///< by time, wherever the motion shows one
    std::optional<Duration> calibrated;  ///< as Kalibr found it
    std::string problem{};               ///< why there are none
};

}  // namespace versavis::client
