// SPDX-License-Identifier: BSD-3-Clause
// Where the service keeps what it learns once and uses later.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include "versavis/error.hpp"

namespace versavis::daemon {

/// As configured; else systemd's; else the usual place.
inline std::filesystem::path state_directory(const std::string& configured) {
    const char* by_systemd = std::getenv("STATE_DIRECTORY");
    if (!configured.empty()) return configured;
    return by_systemd != nullptr ? by_systemd : "/var/lib/versavis";
}

/// Makes it, unless nobody has named one. Error: nothing can be kept there.
inline Expected<> make_state_directory(const std::string& configured) {
    if (configured.empty() && std::getenv("STATE_DIRECTORY") == nullptr) return {};
    const std::filesystem::path path = state_directory(configured);
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (!error && ::access(path.c_str(), W_OK | X_OK) != 0)
        error = {errno, std::generic_category()};
    if (!error) return {};
    return failure(path.string(),
                   "what is measured and checked will not be kept here: " + error.message(),
                   "make it the service's, or set 'state_directory'; then restart the service");
}

}  // namespace versavis::daemon
