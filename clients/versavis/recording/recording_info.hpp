// SPDX-License-Identifier: BSD-3-Clause
// What a recording holds, for people and for scripts.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "recording/recording.hpp"

namespace versavis::client {

/// Error: the file is damaged where its streams must be read.
Expected<nlohmann::json> recording_info(const std::string& path, const Recording& recording);

std::string info_text(const nlohmann::json& info);

}  // namespace versavis::client
