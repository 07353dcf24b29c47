// SPDX-License-Identifier: BSD-3-Clause
// What lies where in the board's flash; freestanding.
#pragma once

#include <cstdint>

namespace versavis::wire {

/// Where the RP2040 sees its flash, of which a Raspberry Pi Pico has the least.
inline constexpr std::uint32_t flash_begin = 0x10000000;
inline constexpr std::uint32_t flash_size = 2 * 1024 * 1024;

/// The flash is written by pages and erased by sectors.
inline constexpr std::uint32_t flash_page = 256;
inline constexpr std::uint32_t flash_sector = 4096;

/// The last sectors hold the board's own settings, by turns. What is before them is the firmware's.
inline constexpr unsigned settings_places = 2;
inline constexpr std::uint32_t settings_begin =
    flash_begin + flash_size - settings_places * flash_sector;

/// The last two words of the firmware's last page: this one, and the CRC-32 of all before.
inline constexpr std::uint32_t firmware_seal = 0x4C535656;

}  // namespace versavis::wire
