// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/grey_image.hpp"

#include <algorithm>
#include <string_view>

#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

void blur(GreyImage& image) {
    const auto at = [&](std::uint32_t x, std::uint32_t y) -> unsigned {
        return image.pixels[std::size_t{y} * image.width + x];
    };
    for (std::uint32_t y = 0; y < image.height; ++y)
        for (std::uint32_t x = 0; x < image.width; ++x) {
            const std::uint32_t right = std::min(x + 1, image.width - 1);
            const std::uint32_t below = std::min(y + 1, image.height - 1);
            const unsigned sum = at(x, y) + at(right, y) + at(x, below) + at(right, below);
            image.pixels[std::size_t{y} * image.width + x] = static_cast<std::uint8_t>(sum / 4);
        }
}

}  // namespace

GreyImage grey_image(const GreyPicture& picture, std::uint32_t pixel_format) {
    GreyImage image{picture.width, picture.height, {}};
    image.pixels.reserve(picture.pixels.size());
    const unsigned full = picture.full;
    for (const unsigned pixel : picture.pixels)
        image.pixels.push_back(static_cast<std::uint8_t>(std::min(pixel, full) * 255 / full));
    if (std::string_view(pixel_format_name(pixel_format)).substr(0, 5) == "Bayer") blur(image);
    return image;
}

}  // namespace versavis::client
