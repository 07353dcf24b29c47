// SPDX-License-Identifier: BSD-3-Clause
// TDK ICM-42688-P, from its data sheet DS-000347 rev 1.5: 2000 deg/s, 16 g, 12.5 Hz to 8 kHz.
#pragma once

#include "imu/byte_register_part.hpp"

namespace versavis::firmware {

class Icm42688p final : public ByteRegisterPart {
 public:
    wire::ImuKind kind() const override { return wire::ImuKind::icm42688p; }
    std::uint16_t identity() const override { return 0x47; }
    std::uint32_t fastest_millihertz() const override { return 8'000'000; }
    std::uint32_t fastest_i2c_millihertz() const override { return 1'000'000; }
    std::uint8_t strongest_filter() const override { return 7; }
    std::uint32_t rate(std::uint32_t wanted_millihertz) const override;
    void setup(const PartSettings& settings, Setup& setup) const override;
    unsigned readings() const override { return 2; }
    void reading(unsigned index, ImuTransfer& transfer) const override;
    Verdict parse(const ImuReply* replies, unsigned count, wire::ImuSample& sample) const override;

 private:
    std::uint32_t clock_hz() const override { return 20'000'000; }
    std::size_t dummies(std::uint8_t /*chip*/) const override { return 0; }
};

}  // namespace versavis::firmware
