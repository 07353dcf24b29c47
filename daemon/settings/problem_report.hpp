// SPDX-License-Identifier: BSD-3-Clause
// What is wrong in a file, for programs: one JSON document.
#pragma once

#include <string>
#include <vector>

#include "engine/toml/problem.hpp"

namespace versavis::daemon {

/// {"file", "files", "problems": [{"file", "line", "column", "table", "key", "unit", "minimum",
/// "maximum", "what", "cure"}]}; a problem has those of its members that mean something. The first
/// of the files is the one that was named.
std::string to_json(const std::vector<std::string>& files, const TomlProblems& problems);

}  // namespace versavis::daemon
