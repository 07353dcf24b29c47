// SPDX-License-Identifier: BSD-3-Clause
// Serial numbers of IMU samples, by which a judge recognises them.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace versavis::rig {

/// The magnetometer shows the serial number of a sample instead of a field, in x and y: the data
/// itself says which sample it is, whatever board and service say.
struct SampleMark {
    static constexpr double lsb_gauss = 1.0 / 7000;
    static constexpr double tesla_per_gauss = 1e-4;

    static std::array<double, 3> field_gauss(std::uint32_t serial) {
        return {static_cast<std::int16_t>(serial) * lsb_gauss,
                static_cast<std::int16_t>(serial >> 16U) * lsb_gauss, 0.4};
    }

    static std::uint32_t serial_in(const float (&field_tesla)[3]) {
        return word(field_tesla[0]) | std::uint32_t{word(field_tesla[1])} << 16U;
    }

 private:
    static std::uint16_t word(float tesla) {
        return static_cast<std::uint16_t>(std::lround(tesla / (lsb_gauss * tesla_per_gauss)));
    }
};

}  // namespace versavis::rig
