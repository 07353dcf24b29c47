// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace versavis::web {

struct Settings {
    std::string instance;
    std::string address = "127.0.0.1";
    std::uint16_t port = 8765;  ///< that of Foxglove's servers by convention; 0: any
    std::string token;          ///< that requests must give; empty: none, only from this host
};

}  // namespace versavis::web
