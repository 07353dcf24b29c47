// SPDX-License-Identifier: BSD-3-Clause
// What every frame bears, and the wall that cameras see while the rig nods.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace versavis::rig {

/// First bytes of each frame's pixels, so that a test knows which exposure it is looking at.
struct FrameMark {
    static constexpr std::uint64_t expected_magic = 0x4B52414D47495256;  // "VRIGMARK"
    std::uint64_t magic;
    std::uint64_t serial;

    /// Of the exposure that the frame shows; 0 if it has no mark.
    static std::uint64_t serial_in(const void* pixels, std::size_t size);
};

/// A textured wall, rendered once at twice the height of the image: a view of it needs no copying.
class Wall {
 public:
    Wall(std::uint32_t width, std::uint32_t height, std::uint64_t seed);

    /// Pixels (8 bit, row by row) that a camera sees at `pitch_rad`.
    std::span<const std::uint8_t> view(double pitch_rad) const;

 private:
    std::uint32_t width_;
    std::uint32_t height_;
    std::vector<std::uint8_t> pixels_;
};

}  // namespace versavis::rig
