// SPDX-License-Identifier: BSD-3-Clause
// A frame as grey levels, whatever its pixel format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

struct GreyPicture {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint16_t> pixels;  ///< row by row
    std::uint16_t full = 255;           ///< what a saturated pixel shows

    std::uint16_t at(std::size_t x, std::size_t y) const { return pixels[y * width + x]; }
};

/// Colours are averaged; of a Bayer mosaic each pixel counts as it is. Errors, about `stream`: a
/// format that packs pixels across bytes; fewer bytes than the metadata says.
Expected<GreyPicture> grey_picture(const std::string& stream, const FrameMetadata& frame,
                                   std::span<const std::byte> pixels);

/// The highest value of a pixel: formats of two bytes may use fewer bits.
std::uint16_t full_scale(std::uint32_t pixel_format);

}  // namespace versavis::client
