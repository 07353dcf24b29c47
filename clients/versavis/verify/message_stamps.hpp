// SPDX-License-Identifier: BSD-3-Clause
// The stamps that tools of ROS read, against those of the items: both are in a recording.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Of each stream, by the output time of the item: by how much the stamp of one of its ROS messages
/// differs from it.
using MessageStamps = std::map<std::string, std::map<std::int64_t, Duration>>;

/// Adds those of one file of a recording. Error: it cannot be read.
Expected<> compare_message_stamps(const std::string& path, MessageStamps& differing);

}  // namespace versavis::client
