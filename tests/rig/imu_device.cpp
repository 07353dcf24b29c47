// SPDX-License-Identifier: BSD-3-Clause
#include "imu_device.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "imu_sampler.hpp"

namespace versavis::rig {

namespace adis = firmware::adis16448;

namespace {

constexpr double gyro_lsb_rad_s = 0.04 * 3.14159265358979 / 180;
constexpr double accel_lsb_g = 1.0 / 1200;
constexpr double pressure_lsb_mbar = 0.02;
constexpr double temperature_lsb_c = 0.07386;

std::int16_t counts(double value, double lsb) {
    return static_cast<std::int16_t>(std::clamp(std::round(value / lsb), -32768.0, 32767.0));
}

}  // namespace

void ImuDevice::burst(HostTime at, std::span<const std::uint8_t> transmitted,
                      std::span<std::uint8_t> received) const {
    std::fill(received.begin(), received.end(), std::uint8_t{0});
    if (received.size() != adis::burst_bytes || transmitted[0] != adis::burst_command) return;
    const double pitch = motion_.pitch_rad(at);
    const std::array<std::int16_t, 12> registers{
        0,  // diagnosis: nothing to report
        counts(motion_.pitch_rate_rad_s(at), gyro_lsb_rad_s),
        0,
        0,
        0,
        counts(std::sin(pitch), accel_lsb_g),
        counts(std::cos(pitch), accel_lsb_g),
        counts(0.2, 142.9e-6),
        0,
        counts(0.4, 142.9e-6),
        static_cast<std::int16_t>(static_cast<std::uint16_t>(1013.25 / pressure_lsb_mbar)),
        counts(36.0 - 31.0, temperature_lsb_c)};
    std::uint8_t* out = received.data() + 2;
    const auto put = [&out](std::uint16_t word) {
        *out++ = static_cast<std::uint8_t>(word >> 8U);
        *out++ = static_cast<std::uint8_t>(word);
    };
    for (const std::int16_t word : registers) put(static_cast<std::uint16_t>(word));
    put(adis::burst_crc(received.data() + 2));
}

}  // namespace versavis::rig
