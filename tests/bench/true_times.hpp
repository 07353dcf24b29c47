// SPDX-License-Identifier: BSD-3-Clause
// Reads from the rig's truth when something happened to each exposure of a camera.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "versavis/time.hpp"

namespace versavis::bench {

/// By the serial in the frame's pixels.
using TimesBySerial = std::map<std::uint64_t, HostTime>;

/// `key` of all records of this type; docs/user/rig.md lists both.
TimesBySerial true_times(const std::string& truth_path, const std::string& camera,
                         const std::string& type, const std::string& key);

}  // namespace versavis::bench
