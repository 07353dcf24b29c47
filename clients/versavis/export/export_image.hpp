// SPDX-License-Identifier: BSD-3-Clause
// A frame's pixels as others' tools take them: named, and of full scale.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

/// How frames of a pixel format are exported.
struct ExportFormat {
    std::string encoding;  ///< as ROS names it
    std::uint32_t channels = 1;
    std::uint32_t bytes = 1;  ///< of a channel
    std::uint32_t shift = 0;  ///< left, so that 10 to 14 bits have the scale of 16
    bool bgr = false;
};

/// Error: packed, or unknown to the tools.
Expected<ExportFormat> export_format(const std::string& stream, std::uint32_t pixel_format);

/// Rows without padding, words little-endian and of full scale. Empty: `payload` is too short.
std::vector<std::byte> export_pixels(const ExportFormat& format, const FrameMetadata& frame,
                                     std::span<const std::byte> payload);

/// Writes such rows as PNG. Error: the file cannot be written.
Expected<> write_png(const std::string& path, const ExportFormat& format, std::uint32_t width,
                     std::uint32_t height, std::span<const std::byte> pixels);

}  // namespace versavis::client
