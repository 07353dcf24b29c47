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
#include "wire/flash_map.hpp"

namespace versavis::client {

using wire::flash_begin;
using wire::flash_page;
using wire::flash_sector;

/// What the flash shall hold: whole sectors by their addresses. Bytes that the file leaves open are
/// as erasing leaves them.
struct FlashImage {
    std::map<std::uint32_t, std::vector<std::uint8_t>> sectors;
    std::size_t pages = 0;  ///< that the file has
};

/// `file` names it in errors. What is returned is firmware of VersaVIS, undamaged, that the chip
/// accepts, and leaves the board's settings alone.
Expected<FlashImage> parse_uf2(std::span<const std::uint8_t> bytes, const std::string& file);
Expected<FlashImage> read_uf2(const std::string& file);

/// The chip's own check of the first page: CRC-32 of polynomial 0x04C11DB7, not reflected.
std::uint32_t boot_stage_crc(std::span<const std::uint8_t> bytes);

}  // namespace versavis::client
