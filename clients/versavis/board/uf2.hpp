// SPDX-License-Identifier: BSD-3-Clause
// Reads UF2 files: the image of an RP2040's flash, in blocks that say where they belong.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

/// Where the RP2040 sees its flash, and the most that it can address there.
inline constexpr std::uint32_t flash_begin = 0x10000000;
inline constexpr std::uint32_t flash_end = 0x11000000;

/// The flash is written by pages and erased by sectors.
inline constexpr std::uint32_t flash_page = 256;
inline constexpr std::uint32_t flash_sector = 4096;

/// What the flash shall hold: whole sectors by their addresses. Bytes that the file leaves open are
/// as erasing leaves them.
struct FlashImage {
    std::map<std::uint32_t, std::vector<std::uint8_t>> sectors;
    std::size_t pages = 0;  ///< that the file has
};

/// `file` names it in errors. What is returned would start: its first page is a boot stage that the
/// chip accepts.
Expected<FlashImage> parse_uf2(std::span<const std::uint8_t> bytes, const std::string& file);
Expected<FlashImage> read_uf2(const std::string& file);

/// The chip's own check of the first page: CRC-32 of polynomial 0x04C11DB7, not reflected.
std::uint32_t boot_stage_crc(std::span<const std::uint8_t> bytes);

}  // namespace versavis::client
