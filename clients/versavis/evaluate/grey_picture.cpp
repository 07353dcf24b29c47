// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/grey_picture.hpp"

#include <fmt/format.h>

#include "versavis/pixel_format.hpp"

namespace versavis::client {

std::uint16_t full_scale(std::uint32_t pixel_format) {
    const std::string format = pixel_format_name(pixel_format);
    if (pixel_layout(pixel_format).bytes_per_channel == 1) return 255;
    for (const unsigned bits : {10U, 12U, 14U})
        if (format.ends_with(std::to_string(bits)))
            return static_cast<std::uint16_t>((1U << bits) - 1);
    return 0xFFFF;
}

Expected<GreyPicture> grey_picture(const std::string& stream, const FrameMetadata& frame,
                                   std::span<const std::byte> pixels) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const std::string format = pixel_format_name(frame.pixel_format);
    if (layout.channels == 0)
        return failure(stream, fmt::format("its pixel format, {}, cannot be evaluated", format),
                       "record with an unpacked one, such as Mono8");
    const std::size_t row = std::size_t{frame.width} * layout.channels * layout.bytes_per_channel;
    const bool fits = frame.width > 0 && frame.height > 0 && frame.stride >= row &&
                      pixels.size() >= std::size_t{frame.height - 1} * frame.stride + row;
    if (!fits)
        return failure(stream,
                       fmt::format("a frame of {} x {} pixels has only {} bytes", frame.width,
                                   frame.height, pixels.size()),
                       "the recording is damaged there; record again");
    GreyPicture picture;
    picture.width = frame.width;
    picture.height = frame.height;
    picture.full = full_scale(frame.pixel_format);
    picture.pixels.resize(std::size_t{frame.width} * frame.height);
    std::size_t out = 0;
    for (std::size_t y = 0; y < frame.height; ++y) {
        const std::byte* from = pixels.data() + y * frame.stride;
        for (std::size_t x = 0; x < frame.width; ++x) {
            unsigned sum = 0;
            for (std::uint32_t c = 0; c < layout.channels; ++c) {
                sum += std::to_integer<unsigned>(*from++);
                if (layout.bytes_per_channel == 2) sum += std::to_integer<unsigned>(*from++) << 8U;
            }
            picture.pixels[out++] = static_cast<std::uint16_t>(sum / layout.channels);
        }
    }
    return picture;
}

}  // namespace versavis::client
