// SPDX-License-Identifier: BSD-3-Clause
// The status document as text for a person.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace versavis::client {

std::string status_text(const nlohmann::json& status);

}  // namespace versavis::client
