// SPDX-License-Identifier: BSD-3-Clause
// What a message says that its witnesses contradict.
#pragma once

#include <cstdint>

#include "versavis/metadata.hpp"

namespace versavis {

struct Implausibility {
    EventReason reason = EventReason::none;
    std::int64_t said = 0;      ///< by the message
    std::int64_t expected = 0;  ///< by its witnesses
};

}  // namespace versavis
