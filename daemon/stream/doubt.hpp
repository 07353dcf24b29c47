// SPDX-License-Identifier: BSD-3-Clause
// What a message says that its witnesses contradict.
#pragma once

#include <cstdint>

#include "versavis/metadata.hpp"

namespace versavis::daemon {

struct Doubt {
    EventReason reason = EventReason::none;
    std::int64_t said = 0;      ///< by the message
    std::int64_t expected = 0;  ///< by its witnesses
};

/// The board has run for less than 146 years: differences of such times do not overflow.
inline bool in_life(std::int64_t board_ns) {
    return board_ns >= 0 && board_ns < std::int64_t{1} << 62U;
}

}  // namespace versavis::daemon
