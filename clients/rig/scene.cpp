// SPDX-License-Identifier: BSD-3-Clause
#include "scene.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace versavis::rig {

namespace {

/// A hash of two cell coordinates: brightness that looks random but is the same in each run.
std::uint8_t cell_brightness(std::uint64_t x, std::uint64_t y, std::uint64_t seed) {
    std::uint64_t h =
        seed * 0x9E3779B97F4A7C15U + x * 0xC2B2AE3D27D4EB4FU + y * 0x165667B19E3779F9U;
    h ^= h >> 29U;
    h *= 0xBF58476D1CE4E5B9U;
    return static_cast<std::uint8_t>(h >> 56U);
}

}  // namespace

std::uint64_t FrameMark::serial_in(const void* pixels, std::size_t size) {
    FrameMark mark{};
    if (size >= sizeof mark) std::memcpy(&mark, pixels, sizeof mark);
    return mark.magic == expected_magic ? mark.serial : 0;
}

Wall::Wall(std::uint32_t width, std::uint32_t height, std::uint64_t seed)
    : width_(width), height_(height), pixels_(std::size_t{width} * height * 2) {
    constexpr std::uint32_t cell = 24;
    for (std::uint32_t y = 0; y < 2 * height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            pixels_[std::size_t{y} * width + x] = cell_brightness(x / cell, y / cell, seed);
}

std::span<const std::uint8_t> Wall::view(double pitch_rad) const {
    const double centre = height_ / 2.0;
    const double row =
        std::clamp(centre * (1 + pitch_rad / 0.5), 0.0, static_cast<double>(height_));
    const std::size_t size = std::size_t{width_} * height_;
    return std::span(pixels_).subspan(static_cast<std::size_t>(std::lround(row)) * width_, size);
}

}  // namespace versavis::rig
