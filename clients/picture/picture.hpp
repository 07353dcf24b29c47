// SPDX-License-Identifier: BSD-3-Clause
// A frame as people look at it: colours by its Bayer pattern, JPEG, and how its values are spread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

inline constexpr std::size_t histogram_bins = 64;

struct Picture {
    std::string jpeg;
    std::uint32_t width = 0;  ///< of the JPEG
    std::uint32_t height = 0;
    std::array<std::uint32_t, histogram_bins>
        histogram{};       ///< values of all pixels, dark to bright
    double saturated = 0;  ///< fraction of the values that are at full scale
};

/// The frame as 8-bit values, interleaved: rows without padding.
struct Pixels {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t channels = 1;
    std::vector<std::uint8_t> values;
};

/// Each pixel has its own colour and those of its neighbours, bilinear. `pattern`: of the first two
/// pixels of the first two rows, as "rggb". `raw` has one channel.
Pixels demosaic(const Pixels& raw, const std::string& pattern);

/// Each 2 x 2 pixels of the pattern make one: half as wide and high.
Pixels demosaic_by_cells(const Pixels& raw, const std::string& pattern);

/// The mean of `factor` x `factor` pixels each.
Pixels reduced(const Pixels& pixels, std::uint32_t factor);

/// `widest`: a wider frame is reduced by a whole factor. Errors: a pixel format that is packed or
/// unknown; fewer bytes than the metadata claim; a frame without pixels.
Expected<Picture> make_picture(const std::string& stream, const FrameMetadata& frame,
                               std::span<const std::byte> payload, std::uint32_t widest);

}  // namespace versavis::client
