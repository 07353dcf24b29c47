// SPDX-License-Identifier: BSD-3-Clause
// How the board names itself on USB; freestanding.
#pragma once

#include <cstdint>

namespace versavis::wire {

/// Placeholders for a number of our own: pid.codes, of which this product is not yet registered.
inline constexpr std::uint16_t usb_vendor = 0x1209;
inline constexpr std::uint16_t usb_product = 0x5653;

/// A chip whose boot loader runs: the board's own, and the one of a Pico 2.
inline constexpr std::uint16_t boot_loader_vendor = 0x2E8A;
inline constexpr std::uint16_t boot_loader_rp2040 = 0x0003;
inline constexpr std::uint16_t boot_loader_rp2350 = 0x000F;

}  // namespace versavis::wire
