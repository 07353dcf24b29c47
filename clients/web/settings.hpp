// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace versavis::web {

struct Settings {
    std::string instance;
    std::string address = "127.0.0.1";
    std::uint16_t port = 8765;  ///< that of Foxglove's servers by convention; 0: any
    std::string token{};        ///< that requests must give; empty: none, only from this host
    std::string record_to{};    ///< folder of recordings; empty: none are made
    std::vector<std::string> origins{};  ///< whose pages may open WebSockets

    /// No browser names none.
    bool allows(std::string_view origin) const {
        return origin.empty() || std::find(origins.begin(), origins.end(), origin) != origins.end();
    }
};

}  // namespace versavis::web
