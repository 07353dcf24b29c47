// SPDX-License-Identifier: BSD-3-Clause
// How the board names itself on USB; freestanding.
#pragma once

#include <cstdint>

namespace versavis::wire {

/// Placeholders for a number of our own: pid.codes, of which this product is not yet registered.
inline constexpr std::uint16_t usb_vendor = 0x1209;
inline constexpr std::uint16_t usb_product = 0x5653;

}  // namespace versavis::wire
