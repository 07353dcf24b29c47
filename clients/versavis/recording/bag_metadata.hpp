// SPDX-License-Identifier: BSD-3-Clause
// metadata.yaml: by it rosbag2 and others open a folder of several files as one recording.
#pragma once

#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

/// The text for these files, which lie in one folder, in their order. Error: one has no summary.
Expected<std::string> bag_metadata(const std::vector<std::string>& files);

}  // namespace versavis::client
