// SPDX-License-Identifier: BSD-3-Clause
// What a host has heard, as lines that can be compared with those of another board.
#pragma once

#include <string>

#include "host_model.hpp"

namespace versavis::scenario {

/// A line for each record, event and sample, sorted by stream:
///
///     STREAM NAME=VALUE ... @ TIME ...
///
/// In a stream, equal boards have the same values, and the same times apart from a constant: when
/// it begins depends on how long a board takes to be configured. Unknown times are `-`.
std::string message_log(const Inbox& inbox);

}  // namespace versavis::scenario
