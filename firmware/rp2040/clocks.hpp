// SPDX-License-Identifier: BSD-3-Clause
// Clocks of the chip: all of them from the crystal, so that the timer and the state machines keep
// the same pace.
#pragma once

#include <cstdint>

namespace versavis::rp2040 {

/// Of the processor and the state machines. If lower, stamps are coarser; if higher, the chip is
/// beyond its limits.
inline constexpr std::uint32_t clock_hz = 125'000'000;
inline constexpr std::uint32_t cycle_ns = 1'000'000'000 / clock_hz;

/// Returns once all clocks run, and the timer counts microseconds from 0.
void start_clocks();

}  // namespace versavis::rp2040
