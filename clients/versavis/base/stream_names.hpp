// SPDX-License-Identifier: BSD-3-Clause
// The streams of an instance.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "versavis/ring_path.hpp"

namespace versavis::client {

/// Those that are there, in alphabetical order.
inline std::vector<std::string> stream_names(const std::string& instance) {
    std::vector<std::string> names;
    std::error_code error;
    for (const auto& entry :
         std::filesystem::directory_iterator(instance_directory(instance), error))
        if (is_stream_name(entry.path().filename().string()))
            names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
}

}  // namespace versavis::client
