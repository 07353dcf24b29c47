// SPDX-License-Identifier: BSD-3-Clause
// What a camera of the rig sees while it exposes: the wall or the moving world, and the LED board.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "motion.hpp"
#include "scene.hpp"
#include "sphere.hpp"
#include "timing_board.hpp"

namespace versavis::rig {

/// What all cameras see.
struct Surroundings {
    explicit Surroundings(HostTime zero, const Scenario& scenario = {});

    Motion motion;
    std::unique_ptr<Sphere> world;      ///< none: the wall
    std::unique_ptr<TimingBoard> leds;  ///< none: there is no LED board
};

class CameraView {
 public:
    CameraView(const Scenario& scenario, const CameraScenario& settings,
               const Surroundings& surroundings);

    /// False: it is a part of wall(), with nothing to compute.
    bool painted() const;
    std::span<const std::uint8_t> wall(HostTime at) const;

    /// Paints the picture of an exposure; the first rows of it, where `out` is smaller. `serial`
    /// draws its noise.
    void paint(HostTime start, HostTime end, std::uint64_t serial,
               std::span<std::uint8_t> out) const;

    /// Of the camera.
    const Pinhole& pinhole() const { return pinhole_; }

 private:
    void paint_world(HostTime start, HostTime end, std::span<std::uint8_t> out) const;
    void paint_leds(const TimingBoard::Row& row, std::span<std::uint8_t> out) const;
    void light_up(Duration exposure, std::span<std::uint8_t> out) const;
    void add_noise(std::uint64_t serial, std::span<std::uint8_t> out) const;

    CameraScenario settings_;
    std::uint64_t seed_;
    const Surroundings& surroundings_;
    Pinhole pinhole_;
    Eigen::Matrix3d imu_from_camera_;
    std::optional<Wall> wall_;
    std::vector<std::int8_t> noise_;
};

}  // namespace versavis::rig
