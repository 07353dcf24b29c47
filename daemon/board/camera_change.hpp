// SPDX-License-Identifier: BSD-3-Clause
// Which cameras a new configuration changes, if the others need not stop for it.
#pragma once

#include "wire/configuration.hpp"

namespace versavis::daemon {

/// Masks of outputs.
struct CameraChange {
    std::uint8_t outputs = 0;     ///< 0: all have to stop, or nothing changes
    std::uint8_t other_rate = 0;  ///< those of them whose rate changes
};

/// A camera that takes over the rate of one that goes on would not have its ticks, without which
/// readers find no sets of both: then all have to stop.
CameraChange camera_change(const wire::Configuration& before, const wire::Configuration& after);

}  // namespace versavis::daemon
