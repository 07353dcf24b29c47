// SPDX-License-Identifier: BSD-3-Clause
// The report of `versavis evaluate allan`, for people and for scripts.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "evaluate/allan.hpp"

namespace versavis::client {

nlohmann::json to_json(const AllanResult& result);
std::string to_text(const AllanResult& result);

/// "45 s", "20 min", "3.5 h".
std::string span_text(double seconds);

}  // namespace versavis::client
