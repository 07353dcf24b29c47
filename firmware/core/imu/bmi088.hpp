// SPDX-License-Identifier: BSD-3-Clause
// Bosch BMI088, from its data sheet BST-BMI088-DS001 rev 1.4: gyro (chip 0) at 2000 deg/s, which
// paces the samples, and accelerometer (chip 1) at 24 g.
#pragma once

#include "imu/byte_register_part.hpp"

namespace versavis::firmware {

class Bmi088 final : public ByteRegisterPart {
 public:
    wire::ImuKind kind() const override { return wire::ImuKind::bmi088; }
    std::uint16_t identity() const override { return 0x0F1E; }
    std::uint32_t fastest_millihertz() const override { return 2'000'000; }
    std::uint8_t strongest_filter() const override { return 2; }
    std::uint32_t accel_millihertz() const override { return 1'600'000; }
    AccelBytes accel_bytes() const override;
    std::uint32_t rate(std::uint32_t wanted_millihertz) const override;
    void setup(const PartSettings& settings, Setup& setup) const override;
    unsigned readings() const override { return 3; }
    void reading(unsigned index, ImuTransfer& transfer) const override;
    Verdict parse(const ImuReply* replies, unsigned count, wire::ImuSample& sample) const override;

 private:
    std::uint32_t clock_hz() const override { return 10'000'000; }
    std::size_t dummies(std::uint8_t chip) const override { return chip == 1 ? 1 : 0; }
};

}  // namespace versavis::firmware
