// SPDX-License-Identifier: BSD-3-Clause
// Prints the items of a stream as they arrive, one per line.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

struct TailSettings {
    std::string instance;
    std::string stream;
    std::uint64_t count = 0;  ///< items to print; 0: until stopped
    bool json = false;
    bool oldest = false;  ///< begin with the oldest item that the ring still holds
    std::function<bool()> stop;
    Duration wait = milliseconds(200);  ///< between looks at `stop`
};

/// Error: no such stream.
Expected<> tail(const TailSettings& settings);

}  // namespace versavis::client
