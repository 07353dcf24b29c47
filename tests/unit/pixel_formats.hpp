// SPDX-License-Identifier: BSD-3-Clause
// Numbers of the Pixel Format Naming Convention.
#pragma once

#include <cstdint>

namespace versavis::test {

inline constexpr std::uint32_t mono8 = 0x01080001;
inline constexpr std::uint32_t bayer_rg8 = 0x01080009;
inline constexpr std::uint32_t mono12 = 0x01100005;
inline constexpr std::uint32_t mono12_packed = 0x010C0006;
inline constexpr std::uint32_t mono12p = 0x010C0047;
inline constexpr std::uint32_t rgb8 = 0x02180014;

}  // namespace versavis::test
