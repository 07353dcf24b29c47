// SPDX-License-Identifier: BSD-3-Clause
// What is wrong in a configuration though each key by itself is right; needs no device.
#pragma once

#include "configuration.hpp"

namespace versavis::daemon {

/// Appends what is wrong and sorts all by file and line. What stands where a problem was found
/// already is left out: it would follow from that one.
void add_problems(const Configuration& configuration, TomlProblems& problems);

/// Most that `latest_arrival_ms` of this camera may be.
double longest_arrival_ms(const CameraConfiguration& camera);

}  // namespace versavis::daemon
