// SPDX-License-Identifier: BSD-3-Clause
// Compares the firmware that a board names in its hello with a release of the host.
#pragma once

#include <string_view>

namespace versavis::board {

/// `firmware` is a name and three numbers, "versavis 0.1.0"; `release` three numbers. What cannot
/// be read so is not older: nothing is claimed of it.
bool is_older(std::string_view firmware, std::string_view release);

}  // namespace versavis::board
