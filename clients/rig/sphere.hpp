// SPDX-License-Identifier: BSD-3-Clause
// A textured world, infinitely far away in every direction, and what a pinhole camera sees of it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace versavis::rig {

/// x to the right, y down, z ahead. The principal point is the middle of the picture, where pixel
/// (0, 0) has its centre at (0, 0).
struct Pinhole {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    double focal_px = 0;

    /// Direction of a pixel, of length 1 along z.
    Eigen::Vector3d ray(double x, double y) const {
        return {(x - (width - 1) / 2.0) / focal_px, (y - (height - 1) / 2.0) / focal_px, 1};
    }
};

class Sphere {
 public:
    /// `focal_px` of the sharpest camera that looks at it.
    Sphere(double focal_px, std::uint64_t seed);

    /// Brightness towards a direction, 0 to 255, interpolated.
    double brightness(const Eigen::Vector3d& direction) const;

    /// Adds 16 times the brightness to each pixel of `sums`, for the camera with this attitude:
    /// vectors of the camera, in the world.
    void add_view(const Pinhole& camera, const Eigen::Matrix3d& attitude,
                  std::span<std::uint16_t> sums) const;

    std::uint32_t face_size() const { return size_; }

 private:
    /// On a face of the cube around the world, in texels.
    struct Spot {
        unsigned face = 0;
        double x = 0;
        double y = 0;
    };

    void paint(unsigned face, std::uint64_t seed);
    Spot spot(const Eigen::Vector3d& direction) const;
    const std::uint8_t* face(unsigned number) const {
        return texels_.data() + std::size_t{number} * size_ * size_;
    }
    unsigned sample(const std::uint8_t* face, std::uint32_t x, std::uint32_t y) const;
    unsigned sample(const Spot& at) const;
    void add_row(const Pinhole& camera, const Eigen::Matrix3d& attitude, std::uint32_t y,
                 std::span<std::uint16_t> sums) const;

    std::uint32_t size_;
    std::vector<std::uint8_t> texels_;  ///< six faces, row by row
};

}  // namespace versavis::rig
