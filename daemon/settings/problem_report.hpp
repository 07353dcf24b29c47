// SPDX-License-Identifier: BSD-3-Clause
// What is wrong in a file, for programs: one JSON document.
#pragma once

#include <string>

#include "engine/toml/problem.hpp"

namespace versavis::daemon {

/// {"file", "problems": [{"line", "column", "table", "key", "unit", "minimum", "maximum", "what",
/// "cure"}]}; a problem has those of its members that mean something.
std::string to_json(const std::string& path, const TomlProblems& problems);

}  // namespace versavis::daemon
