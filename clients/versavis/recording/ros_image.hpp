// SPDX-License-Identifier: BSD-3-Clause
// Images as they stand in a recording: ROS 2 messages in CDR, and PNG unpacked to pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "versavis/metadata.hpp"

namespace versavis::client {

/// sensor_msgs/msg/Image. Text and data lie in the message.
struct RosImage {
    std::uint32_t height;
    std::uint32_t width;
    std::string_view encoding;
    std::uint32_t step;
    std::span<const std::byte> data;
};

/// sensor_msgs/msg/CompressedImage.
struct RosCompressedImage {
    std::string_view format;
    std::span<const std::byte> data;
};

/// None: not such a message, or cut off.
std::optional<RosImage> parse_image(std::span<const std::byte> message);
std::optional<RosCompressedImage> parse_compressed_image(std::span<const std::byte> message);

/// The pixels of a PNG as the camera sent them: rows of `frame.stride` bytes, words of 16 bits
/// little-endian. False: no PNG, damaged, or of another size or format than `frame` says.
bool unpack_png(std::span<const std::byte> png, const FrameMetadata& frame,
                std::vector<std::byte>& pixels);

}  // namespace versavis::client
