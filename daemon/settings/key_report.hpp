// SPDX-License-Identifier: BSD-3-Clause
// The keys of the configuration file, for people and for programs.
#pragma once

#include <string>
#include <vector>

#include "keys.hpp"

namespace versavis::daemon {

std::string to_text(const std::vector<KeyDescription>& keys);

/// [{"table", "key", "default", "range", "meaning"}]
std::string to_json(const std::vector<KeyDescription>& keys);

}  // namespace versavis::daemon
