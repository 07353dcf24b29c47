// SPDX-License-Identifier: BSD-3-Clause
// A frame as grey of 8 bits, for programs that look for corners.
#pragma once

#include <cstdint>
#include <vector>

#include "evaluate/grey_picture.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

struct GreyImage {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint8_t> pixels;  ///< row by row
};

/// Of a Bayer mosaic (`pixel_format`) each pixel is the mean of itself and its neighbours to the
/// right and below: the image then lies half a pixel further left and up.
GreyImage grey_image(const GreyPicture& picture, std::uint32_t pixel_format);

/// By how much a picture may be reduced so that it stays `width` pixels wide, at least. A Bayer
/// mosaic is always reduced, by an even factor, so that each pixel has all colours.
std::uint32_t reduction(const ImageView& view, std::uint32_t width);

/// Each pixel is the mean of a square of `factor` pixels; what is left at the right and below is
/// cut off. The format must not be packed.
GreyImage reduced_image(const ImageView& view, std::uint32_t factor);

}  // namespace versavis::client
