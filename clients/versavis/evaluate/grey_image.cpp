// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/grey_image.hpp"

#include <algorithm>
#include <cstring>
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

bool is_bayer(std::uint32_t pixel_format) {
    return std::string_view(pixel_format_name(pixel_format)).substr(0, 5) == "Bayer";
}

template <class Sample>
void reduce(const ImageView& view, std::uint32_t factor, GreyImage& image) {
    const std::size_t block = std::size_t{factor} * view.layout.channels;  // samples of a row
    const std::uint64_t full = std::uint64_t{full_scale(view.pixel_format)} * block * factor;
    std::vector<std::uint32_t> sums(image.width);
    for (std::uint32_t y = 0; y < image.height; ++y) {
        std::fill(sums.begin(), sums.end(), 0);
        for (std::uint32_t k = 0; k < factor; ++k) {
            const std::byte* from = view.row(y * factor + k);
            for (std::uint32_t& sum : sums)
                for (std::size_t i = 0; i < block; ++i, from += sizeof(Sample)) {
                    Sample sample;
                    std::memcpy(&sample, from, sizeof sample);
                    sum += sample;
                }
        }
        for (const std::uint64_t sum : sums)
            image.pixels.push_back(static_cast<std::uint8_t>(std::min(sum, full) * 255 / full));
    }
}

}  // namespace

std::uint32_t reduction(const ImageView& view, std::uint32_t width) {
    const std::uint32_t factor = std::max(view.width / width, 1U);
    return is_bayer(view.pixel_format) ? std::max(factor / 2 * 2, 2U) : factor;
}

GreyImage reduced_image(const ImageView& view, std::uint32_t factor) {
    GreyImage image{view.width / factor, view.height / factor, {}};
    image.pixels.reserve(std::size_t{image.width} * image.height);
    if (view.layout.bytes_per_channel == 1)
        reduce<std::uint8_t>(view, factor, image);
    else
        reduce<std::uint16_t>(view, factor, image);
    return image;
}

GreyImage grey_image(const GreyPicture& picture, std::uint32_t pixel_format) {
    GreyImage image{picture.width, picture.height, {}};
    image.pixels.reserve(picture.pixels.size());
    const unsigned full = picture.full;
    for (const unsigned pixel : picture.pixels)
        image.pixels.push_back(static_cast<std::uint8_t>(std::min(pixel, full) * 255 / full));
    if (is_bayer(pixel_format)) blur(image);
    return image;
}

}  // namespace versavis::client
