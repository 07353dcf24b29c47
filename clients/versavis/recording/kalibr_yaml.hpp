// SPDX-License-Identifier: BSD-3-Clause
// The YAML files of Kalibr: camchain.yaml, camchain-imucam.yaml and imu.yaml, there and back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

using Transform = std::array<double, 16>;  ///< 4 x 4, row by row

struct CalibratedCamera {
    std::string key;  ///< cam0, cam1, ...
    std::string model;
    std::vector<double> intrinsics;
    std::string distortion;
    std::vector<double> coefficients;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::string topic;
    std::vector<std::uint32_t> overlaps;
    std::optional<Transform> to_previous;  ///< T_cn_cnm1
    std::optional<Transform> from_imu;     ///< T_cam_imu
    std::optional<double> time_shift_s;    ///< timeshift_cam_imu: t_imu = t_cam + it
};

struct ImuNoise {
    double accelerometer_density;  ///< m/s^2/sqrt(Hz)
    double accelerometer_walk;     ///< m/s^3/sqrt(Hz)
    double gyroscope_density;      ///< rad/s/sqrt(Hz)
    double gyroscope_walk;         ///< rad/s^2/sqrt(Hz)
};

/// Errors name the file as `where` and the line.
Expected<std::vector<CalibratedCamera>> parse_camchain(const std::string& text,
                                                       const std::string& where);
Expected<ImuNoise> parse_imu_noise(const std::string& text, const std::string& where);

std::string camchain_text(const std::vector<CalibratedCamera>& cameras);
std::string imu_text(const ImuNoise& noise, const std::string& topic, double rate_hz);

/// Always with a point: Kalibr takes no integers for intrinsics, and Python takes 4e-06 for a text.
std::string yaml_number(double value);

/// The inverse of a rotation and translation.
Transform inverse(const Transform& transform);

/// Cameras of a chain in another order, or some of them: `order` has their places in `chain`. Links
/// (T_cn_cnm1) and overlaps are those of the new order; a link that the chain does not have is
/// none.
std::vector<CalibratedCamera> rearranged(const std::vector<CalibratedCamera>& chain,
                                         const std::vector<std::size_t>& order);

}  // namespace versavis::client
