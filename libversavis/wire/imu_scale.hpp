// SPDX-License-Identifier: BSD-3-Clause
// What one unit of an IMU's raw words is worth, by the data sheets; freestanding C++17.
#pragma once

#include "wire/messages.hpp"

namespace versavis::wire {

/// Scales of one kind of part, for one unit of the word; a linear reading is `raw * scale +
/// offset`.
struct ImuScale {
    ImuKind kind = ImuKind::none;
    double gyro_rad_s = 0;
    double accel_m_s2 = 0;
    double magnetic_t = 0;   ///< 0: no magnetometer
    double pressure_pa = 0;  ///< 0: no barometer
    double temperature_c = 0;
    double temperature_at_zero_c = 0;
};

namespace imu_unit {

inline constexpr double deg_s = 3.14159265358979323846 / 180;
inline constexpr double g = 9.80665;
inline constexpr double gauss = 1e-4;

/// The VN-100's floats come as whole numbers of powers of two (docs/contracts/wire-protocol.md).
constexpr double two_to_the(int exponent) {
    return exponent == 0 ? 1 : two_to_the(exponent + 1) / 2;
}

}  // namespace imu_unit

inline constexpr ImuScale imu_scales[] = {
    {ImuKind::adis16448b, 0.04 * imu_unit::deg_s, imu_unit::g / 1200, imu_unit::gauss / 7000, 2.0,
     0.07386, 31.0},
    {ImuKind::adis16448a, 0.04 * imu_unit::deg_s, imu_unit::g / 1200, imu_unit::gauss / 7000, 2.0,
     0.07386, 31.0},
    {ImuKind::adis16445, 0.01 * imu_unit::deg_s, 0.00025 * imu_unit::g, 0, 0, 0.07386, 31.0},
    {ImuKind::adis16460, 0.005 * imu_unit::deg_s, 0.00025 * imu_unit::g, 0, 0, 0.05, 25.0},
    {ImuKind::adis16470, 0.1 * imu_unit::deg_s, 0.00125 * imu_unit::g, 0, 0, 0.1, 0.0},
    {ImuKind::icm42688p, imu_unit::deg_s / 16.4, imu_unit::g / 2048, 0, 0, 1 / 132.48, 25.0},
    {ImuKind::bmi088, 2000 * imu_unit::deg_s / 32768, 24 * imu_unit::g / 32768, 0, 0, 0.125, 23.0},
    {ImuKind::vn100, imu_unit::two_to_the(-24), imu_unit::two_to_the(-20),
     imu_unit::gauss* imu_unit::two_to_the(-13), 1000 * imu_unit::two_to_the(-8),
     imu_unit::two_to_the(-7), 0.0},
};

/// Scales of this kind; all zero when it is unknown.
constexpr ImuScale imu_scale(ImuKind kind) {
    for (const ImuScale& scale : imu_scales)
        if (scale.kind == kind) return scale;
    return {};
}

}  // namespace versavis::wire
