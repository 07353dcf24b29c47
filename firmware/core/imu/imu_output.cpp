// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_output.hpp"

#include "imu/adis.hpp"
#include "wire/imu_scale.hpp"

namespace versavis::firmware {

namespace {

constexpr std::int64_t q32(double ratio) { return static_cast<std::int64_t>(ratio * 4294967296.0); }

constexpr wire::ImuScale adis16448 = wire::imu_scale(wire::ImuKind::adis16448b);

/// Raw words of a kind in those of an ADIS16448, times 2^32.
struct Scale {
    constexpr explicit Scale(const wire::ImuScale& of)
        : kind(of.kind),
          temperature_offset(static_cast<std::int32_t>(
              (of.temperature_at_zero_c - adis16448.temperature_at_zero_c) /
                  adis16448.temperature_c -
              0.5)),
          gyro(q32(of.gyro_rad_s / adis16448.gyro_rad_s)),
          accel(q32(of.accel_m_s2 / adis16448.accel_m_s2)),
          temperature(q32(of.temperature_c / adis16448.temperature_c)),
          magnetic(q32(of.magnetic_t / adis16448.magnetic_t)),
          pressure(q32(of.pressure_pa / adis16448.pressure_pa)) {}

    wire::ImuKind kind;
    std::int32_t temperature_offset;
    std::int64_t gyro;
    std::int64_t accel;
    std::int64_t temperature;
    std::int64_t magnetic;
    std::int64_t pressure;
};

constexpr Scale scales[] = {
    Scale(wire::imu_scale(wire::ImuKind::adis16445)),
    Scale(wire::imu_scale(wire::ImuKind::adis16460)),
    Scale(wire::imu_scale(wire::ImuKind::adis16470)),
    Scale(wire::imu_scale(wire::ImuKind::icm42688p)),
    Scale(wire::imu_scale(wire::ImuKind::bmi088)),
    Scale(wire::imu_scale(wire::ImuKind::vn100)),
};
constexpr Scale same(adis16448);

constexpr std::uint16_t self_test_failed = 1U << 5U;

std::int64_t scaled(std::int64_t raw, std::int64_t ratio) {
    return (raw * ratio + (std::int64_t{1} << 31U)) >> 32U;
}

std::uint16_t limited(std::int64_t value, std::int64_t lowest, std::int64_t highest) {
    return static_cast<std::uint16_t>(value < lowest ? lowest : value > highest ? highest : value);
}

std::uint16_t as_word(std::int64_t value) { return limited(value, INT16_MIN, INT16_MAX); }

const Scale& scale_of(wire::ImuKind kind) {
    for (const Scale& scale : scales)
        if (scale.kind == kind) return scale;
    return same;
}

}  // namespace

bool adis16448_image(const wire::ImuSample& sample, ImuImage& image) {
    if ((sample.flags & wire::imu_check_failed) != 0) return false;
    const Scale& scale = scale_of(sample.kind);
    image.product = 16448;
    image.burst[0] =
        (sample.flags & wire::imu_self_test_failed) != 0 ? self_test_failed : std::uint16_t{0};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        image.burst[1 + axis] = as_word(scaled(sample.gyro[axis], scale.gyro));
        image.burst[4 + axis] = as_word(scaled(sample.accel[axis], scale.accel));
        image.burst[7 + axis] = as_word(scaled(sample.magnetic[axis], scale.magnetic));
    }
    image.burst[10] = limited(scaled(sample.pressure, scale.pressure), 0, UINT16_MAX);
    const std::int64_t temperature =
        scaled(sample.temperature, scale.temperature) + scale.temperature_offset;
    image.burst[11] = static_cast<std::uint16_t>(limited(temperature, -2048, 2047) & 0xFFFU);
    image.burst[12] = adis16448_crc(image.burst + 1);
    return true;
}

}  // namespace versavis::firmware
