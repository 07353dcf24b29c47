// SPDX-License-Identifier: BSD-3-Clause
// Judges the pulses of an output by what an input saw of them, when a wire joins the two.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

/// Pulses that begin at multiples of the period.
struct SentPulses {
    Duration period;
    Duration width;
    std::size_t count = 0;  ///< that an input sees at least
};

/// Board times of the edges that an input saw, in their order. Rising and falling ones may be those
/// of different pulses.
struct SeenEdges {
    std::vector<std::int64_t> rising_ns;
    std::vector<std::int64_t> falling_ns;
};

enum class LoopResult {
    open,  ///< the input saw none of it
    ok,
    failed,
};

struct LoopFinding {
    LoopResult result = LoopResult::open;
    Duration period;  ///< measured; of a line that is not open
    Duration width;
    std::string hint;  ///< what is wrong and what to check; empty: nothing
};

LoopFinding check_loop(const SentPulses& sent, const SeenEdges& seen);

/// Some of the rising edges are of these pulses, inverted or not: the input hears the output.
bool hears(const SentPulses& sent, const std::vector<std::int64_t>& rising_ns);

}  // namespace versavis::client
