// SPDX-License-Identifier: BSD-3-Clause
// What is wrong in a configuration though each key by itself is right; needs no device.
#pragma once

#include "configuration.hpp"

namespace versavis::daemon {

/// Appends what is wrong and sorts all by line. What stands where a problem was found already is
/// left out: it would follow from that one.
void add_problems(const Configuration& configuration, TomlProblems& problems);

/// An exposure that the board would take for a disturbance of its line.
struct HiddenExposure {
    std::string what;
    std::string cure;
};

/// None: an exposure of so many microseconds, which `key` sets, is seen, or no line is looked at.
std::optional<HiddenExposure> hidden_exposure(const CameraConfiguration& camera,
                                              std::string_view key, double us);

/// Most that `latest_arrival_ms` of this camera may be.
double longest_arrival_ms(const CameraConfiguration& camera);

}  // namespace versavis::daemon
