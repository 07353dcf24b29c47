// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_output.hpp"

#include "imu/adis.hpp"
#include "imu/vn100.hpp"

namespace versavis::firmware {

namespace {

// One LSB of an ADIS16448.
constexpr double gyro_deg_s = 0.04;
constexpr double accel_g = 1.0 / 1200;
constexpr double magnetic_gauss = 1.0 / 7000;
constexpr double pressure_pa = 2.0;
constexpr double temperature_c = 0.07386;
constexpr double temperature_at_zero_c = 31.0;

constexpr std::int64_t q32(double ratio) { return static_cast<std::int64_t>(ratio * 4294967296.0); }

/// Scale from the raw words of a kind to those of an ADIS16448, times 2^32.
struct Scale {
    constexpr Scale(wire::ImuKind of, double gyro_lsb_deg_s, double accel_lsb_g,
                    double temperature_lsb_c, double at_zero_c, double magnetic_lsb_gauss = 0,
                    double pressure_lsb_pa = 0)
        : kind(of),
          gyro(q32(gyro_lsb_deg_s / gyro_deg_s)),
          accel(q32(accel_lsb_g / accel_g)),
          temperature(q32(temperature_lsb_c / temperature_c)),
          temperature_offset(
              static_cast<std::int32_t>((at_zero_c - temperature_at_zero_c) / temperature_c - 0.5)),
          magnetic(q32(magnetic_lsb_gauss / magnetic_gauss)),
          pressure(q32(pressure_lsb_pa / pressure_pa)) {}

    wire::ImuKind kind;
    std::int64_t gyro;
    std::int64_t accel;
    std::int64_t temperature;
    std::int32_t temperature_offset;
    std::int64_t magnetic;
    std::int64_t pressure;
};

constexpr double degrees = 57.29577951308232;
constexpr double gravity = 9.80665;

constexpr Scale scales[] = {
    {wire::ImuKind::adis16445, 0.01, 0.00025, temperature_c, temperature_at_zero_c},
    {wire::ImuKind::adis16460, 0.005, 0.00025, 0.05, 25},
    {wire::ImuKind::adis16470, 0.1, 0.00125, 0.1, 0},
    {wire::ImuKind::icm42688p, 1 / 16.4, 1.0 / 2048, 1 / 132.48, 25},
    {wire::ImuKind::bmi088, 2000.0 / 32768, 24.0 / 32768, 0.125, 23},
    {wire::ImuKind::vn100, degrees / (1U << vn100::gyro_bits),
     1 / gravity / (1U << vn100::accel_bits), 1.0 / (1U << vn100::temperature_bits), 0,
     1.0 / (1U << vn100::magnetic_bits), 1000.0 / (1U << vn100::pressure_bits)},
};
constexpr Scale same{wire::ImuKind::adis16448b, gyro_deg_s,     accel_g,    temperature_c,
                     temperature_at_zero_c,     magnetic_gauss, pressure_pa};

constexpr std::uint16_t self_test_failed = 1U << 5U;

std::uint16_t scaled(std::int64_t raw, std::int64_t ratio, std::int64_t lowest,
                     std::int64_t highest) {
    const std::int64_t value = (raw * ratio + (std::int64_t{1} << 31U)) >> 32U;
    return static_cast<std::uint16_t>(value < lowest ? lowest : value > highest ? highest : value);
}

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
        image.burst[1 + axis] = scaled(sample.gyro[axis], scale.gyro, INT16_MIN, INT16_MAX);
        image.burst[4 + axis] = scaled(sample.accel[axis], scale.accel, INT16_MIN, INT16_MAX);
        image.burst[7 + axis] = scaled(sample.magnetic[axis], scale.magnetic, INT16_MIN, INT16_MAX);
    }
    image.burst[10] = scaled(sample.pressure, scale.pressure, 0, UINT16_MAX);
    const auto warmth = static_cast<std::int16_t>(
        scaled(sample.temperature, scale.temperature, INT16_MIN, INT16_MAX));
    const std::int32_t temperature = warmth + scale.temperature_offset;
    image.burst[11] =
        static_cast<std::uint16_t>(static_cast<std::uint32_t>(temperature < -2048  ? -2048
                                                              : temperature > 2047 ? 2047
                                                                                   : temperature) &
                                   0xFFFU);
    image.burst[12] = adis16448_crc(image.burst + 1);
    return true;
}

}  // namespace versavis::firmware
