// SPDX-License-Identifier: BSD-3-Clause
// Where the service keeps what it learns once and uses later.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace versavis::daemon {

/// As configured; else systemd's; else the usual place.
inline std::filesystem::path state_directory(const std::string& configured) {
    const char* by_systemd = std::getenv("STATE_DIRECTORY");
    if (!configured.empty()) return configured;
    return by_systemd != nullptr ? by_systemd : "/var/lib/versavis";
}

}  // namespace versavis::daemon
