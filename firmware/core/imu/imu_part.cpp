// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_part.hpp"

#include "imu/adis.hpp"
#include "imu/bmi088.hpp"
#include "imu/icm42688p.hpp"

namespace versavis::firmware {

namespace {

using Check = AdisFacts::Check;
using Kind = wire::ImuKind;

// product and its register; GLOB_CMD, MSC_CTRL, rate, filter; their values; rates; burst; failures;
// check; times.
constexpr Adis adis16445({Kind::adis16445, 16445, 0x56, 0x3E, 0x34, 0x36, 0x38, 0x0006, 0x0400,
                          819'200, true, 8, false, 0xFC64, Check::twice, 25'000, 75'000});
constexpr Adis adis16448a({Kind::adis16448a, 16448, 0x56, 0x3E, 0x34, 0x36, 0x38, 0x0006, 0x0400,
                           819'200, true, 12, true, 0xFC67, Check::twice, 25'000, 110'000});
constexpr Adis adis16448b({Kind::adis16448b, 16448, 0x56, 0x3E, 0x34, 0x36, 0x38, 0x0016, 0x0400,
                           819'200, true, 13, true, 0xFC67, Check::crc, 25'000, 110'000});
constexpr Adis adis16460({Kind::adis16460, 16460, 0x56, 0x3E, 0x32, 0x36, 0x38, 0x00C1, 0x0500,
                          2'048'000, false, 10, false, 0x0064, Check::byte_sum, 16'000, 260'000});
constexpr Adis adis16470({Kind::adis16470, 16470, 0x72, 0x68, 0x60, 0x64, 0x5C, 0x00C1, 0x0000,
                          2'000'000, false, 10, false, 0x0076, Check::byte_sum, 16'000, 230'000});
constexpr Icm42688p icm42688p;
constexpr Bmi088 bmi088;

constexpr const ImuPart* parts[] = {&adis16448b, &adis16448a, &adis16445, &adis16460,
                                    &adis16470,  &icm42688p,  &bmi088};

}  // namespace

const ImuPart* find_part(wire::ImuKind kind) {
    for (const ImuPart* part : parts)
        if (part->kind() == kind) return part;
    return nullptr;
}

}  // namespace versavis::firmware
