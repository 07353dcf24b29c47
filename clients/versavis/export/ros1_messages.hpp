// SPDX-License-Identifier: BSD-3-Clause
// Messages of ROS 1: their types, and how they are serialised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "export/bag_writer.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

extern const BagType ros1_image;
extern const BagType ros1_imu;

struct Ros1Header {
    std::uint32_t sequence;
    std::int64_t stamp_ns;
    std::string frame_id;
};

/// An Image up to its pixels, which are `size` bytes.
std::vector<std::byte> ros1_image_head(const Ros1Header& header, std::uint32_t width,
                                       std::uint32_t height, const std::string& encoding,
                                       std::uint32_t step, std::uint32_t size);

std::vector<std::byte> ros1_imu_message(const Ros1Header& header, const ImuMetadata& sample);

}  // namespace versavis::client
