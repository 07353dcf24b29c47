// SPDX-License-Identifier: BSD-3-Clause
// Names as ROS has them. C++17, like all of this folder: ROS 1 is not built as C++20.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace versavis::ros_client {

/// Of a pixel format; that of PFNC where ROS has none.
std::string encoding_of(std::uint32_t pixel_format);

/// A stream's name as a part of a topic that ROS accepts: letters, digits and underscores, no digit
/// in front.
std::string topic_part(std::string_view stream);

}  // namespace versavis::ros_client
