// SPDX-License-Identifier: BSD-3-Clause
// Pixel formats by name, and a frame's pixels as rows.
#pragma once

#include <cstddef>
#include <cstdint>

#include "versavis/export.hpp"

namespace versavis {

/// Name of a code of the GenICam Pixel Format Naming Convention, as "Mono8"; "unknown" for others.
VERSAVIS_API const char* pixel_format_name(std::uint32_t code);

/// How the samples of a pixel lie in memory. Formats that pack samples across bytes have none.
struct PixelLayout {
    std::uint32_t channels = 0;           ///< 0: packed, or unknown
    std::uint32_t bytes_per_channel = 0;  ///< 1 or 2, little-endian
};
VERSAVIS_API PixelLayout pixel_layout(std::uint32_t code);

/// Pixels in place: row y begins at data + y * stride.
struct ImageView {
    const std::byte* data = nullptr;
    std::uint32_t width = 0;   ///< pixels
    std::uint32_t height = 0;  ///< rows
    std::uint32_t stride = 0;  ///< bytes from row to row
    std::uint32_t pixel_format = 0;
    PixelLayout layout;

    const std::byte* row(std::uint32_t y) const { return data + std::size_t{stride} * y; }
};

}  // namespace versavis
