// SPDX-License-Identifier: BSD-3-Clause
// The status document as text for a person.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace versavis::client {

std::string status_text(const nlohmann::json& status);

/// The clock's part alone, one fact per line; keys that this version does not know are shown as
/// they are.
std::string clock_text(const nlohmann::json& status);

}  // namespace versavis::client
