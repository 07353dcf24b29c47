// SPDX-License-Identifier: BSD-3-Clause
// The wiring of cameras, IMUs and LiDARs pin by pin, for a terminal and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "wiring/wired_parts.hpp"

namespace versavis::client {

std::string wiring_text(const WiredParts& parts);

/// {"board", "drivers", "cameras", "imus", "lidars"}; docs/user/wiring.md has the members.
nlohmann::json wiring_json(const WiredParts& parts);

/// The circuits that are known, by name.
std::string circuits_text();

}  // namespace versavis::client
