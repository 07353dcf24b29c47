// SPDX-License-Identifier: BSD-3-Clause
// Frames as PNG, fast: rows as differences to the left, packed by ISA-L at its lowest level.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "versavis/metadata.hpp"

namespace versavis::client {

/// 8 or 16 bits of grey (Bayer patterns, too, as they come), or 8 bits of RGB or BGR; and the
/// payload, of `size` bytes, has all rows.
bool can_be_png(const FrameMetadata& frame, std::size_t size);

/// Only of what can_be_png(). Source: W3C, Portable Network Graphics, third edition.
std::vector<std::byte> encode_png(const FrameMetadata& frame, std::span<const std::byte> pixels);

}  // namespace versavis::client
