// SPDX-License-Identifier: BSD-3-Clause
// What the sequencer sends through the pin of the loop, for the watcher's stamp to be held against:
// both keep the same time, and the way from a pin to its stamp works.
#pragma once

#include <cstdint>

namespace versavis::rp2040 {

/// The output port writes it from its interrupts, the edge port clears `awaited` once it has seen
/// the edge or missed it.
struct LoopSignal {
    volatile bool awaited = false;  ///< an edge was sent, and nothing is known of it yet
    volatile bool proved = false;   ///< the newest edges came back at their times
    bool level = false;
    volatile std::uint32_t at_low_ns =
        0;  ///< when it leaves, or left: the lower bits of board time
};

}  // namespace versavis::rp2040
