// SPDX-License-Identifier: BSD-3-Clause
#include "sphere.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace versavis::rig {

namespace {

constexpr std::uint32_t faces = 6;
/// Texels of a face of the largest texture.
constexpr double largest_face = 2048;
/// Within so many pixels the projection is taken as linear.
constexpr std::uint32_t stretch = 8;
/// Positions in the texture, in fractions of a texel.
constexpr unsigned fraction_bits = 8;
constexpr double fractions = 1U << fraction_bits;

std::uint32_t mix(std::uint32_t a, std::uint32_t b, std::uint64_t seed) {
    std::uint64_t h =
        seed * 0x9E3779B97F4A7C15U + a * 0xC2B2AE3D27D4EB4FU + b * 0x165667B19E3779F9U;
    h ^= h >> 29U;
    h *= 0xBF58476D1CE4E5B9U;
    h ^= h >> 32U;
    return static_cast<std::uint32_t>(h);
}

/// Cells of random brightness, in three sizes: cells per side of a face, and their share.
struct Layer {
    std::uint32_t cells;
    double weight;
};
constexpr Layer layers[] = {{9, 0.3}, {23, 0.35}, {61, 0.35}};

}  // namespace

Sphere::Sphere(double focal_px, std::uint64_t seed)
    : size_(
          std::bit_ceil(static_cast<std::uint32_t>(std::clamp(2 * focal_px, 64.0, largest_face)))),
      texels_(std::size_t{faces} * size_ * size_) {
    for (unsigned face = 0; face < faces; ++face) paint(face, seed);
}

void Sphere::paint(unsigned face, std::uint64_t seed) {
    std::vector<std::uint8_t> sharp(std::size_t{size_} * size_);
    for (std::uint32_t y = 0; y < size_; ++y)
        for (std::uint32_t x = 0; x < size_; ++x) {
            double sum = 0;
            for (const auto& [cells, weight] : layers)
                sum += weight *
                       (mix(x * cells / size_, y * cells / size_, seed * 31 + face * 7 + cells) >>
                        24U);
            sharp[std::size_t{y} * size_ + x] = static_cast<std::uint8_t>(sum);
        }
    // The mean of neighbours: what interpolation shows is as smooth as what a lens does.
    std::uint8_t* out = texels_.data() + std::size_t{face} * size_ * size_;
    const auto at = [&](std::int64_t x, std::int64_t y) -> unsigned {
        const std::int64_t last = std::int64_t{size_} - 1;
        return sharp[static_cast<std::size_t>(std::clamp<std::int64_t>(y, 0, last) * size_ +
                                              std::clamp<std::int64_t>(x, 0, last))];
    };
    for (std::int64_t y = 0; y < size_; ++y)
        for (std::int64_t x = 0; x < size_; ++x) {
            unsigned sum = 0;
            for (std::int64_t dy = -1; dy <= 1; ++dy)
                for (std::int64_t dx = -1; dx <= 1; ++dx)
                    sum += (2U - static_cast<unsigned>(std::abs(dx))) *
                           (2U - static_cast<unsigned>(std::abs(dy))) * at(x + dx, y + dy);
            *out++ = static_cast<std::uint8_t>(sum / 16);
        }
}

Sphere::Spot Sphere::spot(const Eigen::Vector3d& direction) const {
    const double x = std::abs(direction.x());
    const double y = std::abs(direction.y());
    const double z = std::abs(direction.z());
    const unsigned axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    const double scale = (size_ - 1) / 2.0;
    const double along = scale / std::max({x, y, z});
    const double* const d = direction.data();
    // A sample needs the texel after it, too.
    const auto texel = [&](double offset) {
        return std::clamp(offset * along + scale, 0.0, size_ - 1 - 2 / fractions);
    };
    return {2 * axis + (d[axis] < 0 ? 1 : 0), texel(d[axis == 2 ? 0 : axis + 1]),
            texel(d[axis == 0 ? 2 : axis - 1])};
}

/// Brightness x 16 at a position in fractions of a texel.
inline unsigned Sphere::sample(const std::uint8_t* face, std::uint32_t x, std::uint32_t y) const {
    constexpr unsigned one = 1U << fraction_bits;
    const unsigned fx = x & (one - 1);
    const unsigned fy = y & (one - 1);
    const std::uint8_t* texel =
        face + std::size_t{y >> fraction_bits} * size_ + (x >> fraction_bits);
    const unsigned top = texel[0] * (one - fx) + texel[1] * fx;
    const unsigned bottom = texel[size_] * (one - fx) + texel[size_ + 1] * fx;
    return (top * (one - fy) + bottom * fy + (1U << 11U)) >> 12U;
}

unsigned Sphere::sample(const Spot& at) const {
    return sample(face(at.face), static_cast<std::uint32_t>(at.x * fractions),
                  static_cast<std::uint32_t>(at.y * fractions));
}

double Sphere::brightness(const Eigen::Vector3d& direction) const {
    return sample(spot(direction)) / 16.0;
}

void Sphere::add_row(const Pinhole& camera, const Eigen::Matrix3d& attitude, std::uint32_t y,
                     std::span<std::uint16_t> sums) const {
    const auto add = [&sums](std::uint32_t x, unsigned value) {
        sums[x] = static_cast<std::uint16_t>(sums[x] + value);
    };
    // The ray of each pixel follows from the one before by a constant step.
    const Eigen::Vector3d first = attitude * camera.ray(0, y);
    const Eigen::Vector3d step = attitude.col(0) / camera.focal_px;
    Spot begin = spot(first);
    for (std::uint32_t x = 0; x < camera.width; x += stretch) {
        const Spot end = spot(first + step * (x + stretch));
        const std::uint32_t count = std::min(stretch, camera.width - x);
        if (begin.face == end.face) {
            constexpr unsigned finer = 8;  // a step from pixel to pixel has finer fractions
            constexpr double grain = fractions * (1U << finer);
            const std::uint8_t* texels = face(begin.face);
            auto u = static_cast<std::int32_t>(begin.x * grain);
            auto v = static_cast<std::int32_t>(begin.y * grain);
            const auto du = static_cast<std::int32_t>((end.x - begin.x) * (grain / stretch));
            const auto dv = static_cast<std::int32_t>((end.y - begin.y) * (grain / stretch));
            for (std::uint32_t i = 0; i < count; ++i, u += du, v += dv)
                add(x + i, sample(texels, static_cast<std::uint32_t>(u) >> finer,
                                  static_cast<std::uint32_t>(v) >> finer));
        } else {
            for (std::uint32_t i = 0; i < count; ++i)
                add(x + i, sample(spot(first + step * (x + i))));
        }
        begin = end;
    }
}

void Sphere::add_view(const Pinhole& camera, const Eigen::Matrix3d& attitude,
                      std::span<std::uint16_t> sums) const {
    for (std::uint32_t y = 0; y < camera.height; ++y)
        add_row(camera, attitude, y, sums.subspan(std::size_t{y} * camera.width, camera.width));
}

}  // namespace versavis::rig
