// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/stream.hpp"

namespace versavis {

std::optional<ImageView> image_of(const FrameMetadata& frame, const ring::Payload& payload) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const std::uint64_t row =
        std::uint64_t{frame.width} * layout.channels * layout.bytes_per_channel;
    if (frame.width == 0 || frame.height == 0 || frame.stride == 0 || row > frame.stride ||
        std::uint64_t{frame.stride} * frame.height > payload.size())
        return std::nullopt;
    return ImageView{payload.data(), frame.width,        frame.height,
                     frame.stride,   frame.pixel_format, layout};
}

}  // namespace versavis
