// SPDX-License-Identifier: BSD-3-Clause
#include "imu/bmi088.hpp"

#include "imu/imu_words.hpp"

namespace versavis::firmware {

namespace {

constexpr std::uint8_t gyro = 0;
constexpr std::uint8_t accel = 1;
constexpr std::uint16_t gyro_id = 0x0F;
constexpr std::uint16_t accel_id = 0x1E;
constexpr std::uint16_t soft_reset = 0xB6;
constexpr std::uint32_t write_pause_us = 1'000;  // between writes while suspended

enum GyroRegister : std::uint8_t {
    gyro_chip_id = 0x00,  // then one reserved byte and the rates up to 0x07
    gyro_range = 0x0F,
    gyro_bandwidth = 0x10,
    gyro_soft_reset = 0x14,
    gyro_int_ctrl = 0x15,
    gyro_int_io_conf = 0x16,
    gyro_int_io_map = 0x18,
};

enum AccelRegister : std::uint8_t {
    accel_chip_id = 0x00,
    accel_error = 0x02,
    accel_data = 0x12,
    accel_temperature = 0x22,  // high byte first, unlike everything else
    accel_conf = 0x40,
    accel_range = 0x41,
    accel_int1_io_conf = 0x53,
    accel_int_map_data = 0x58,
    accel_pwr_conf = 0x7C,
    accel_pwr_ctrl = 0x7D,
    accel_soft_reset = 0x7E,
};

constexpr std::size_t gyro_burst = 8;
constexpr std::size_t accel_burst = 0x24;

constexpr std::uint8_t error_bits = 0x1D;  // the others are reserved
constexpr std::uint8_t active = 0x00;
constexpr std::uint8_t on = 0x04;

// The codes with the widest bandwidth at each rate.
constexpr RateCode rates[] = {
    {2'000'000, 0}, {1'000'000, 2}, {400'000, 3}, {200'000, 6}, {100'000, 7}};
// The accelerometer has a clock of its own: at its fastest rate, 1.6 kHz, its data is at most
// 625 us older than the gyro's edge.
constexpr std::uint8_t accel_rate = 0xC;

}  // namespace

std::uint32_t Bmi088::rate(std::uint32_t wanted_millihertz) const {
    return slowest_not_below(rates, wanted_millihertz).millihertz;
}

void Bmi088::setup(const PartSettings& settings, Setup& setup) const {
    // The first reading switches the accelerometer from I2C to SPI, and means nothing.
    setup.write(accel, accel_chip_id, 0, write_pause_us);
    setup.write(accel, accel_soft_reset, soft_reset, 5'000);
    setup.write(accel, accel_chip_id, 0, write_pause_us);
    setup.expect(accel, accel_chip_id, accel_id);
    setup.write(accel, accel_pwr_conf, active, 5'000);
    setup.write(accel, accel_pwr_ctrl, on, 50'000);
    const auto bandwidth =
        static_cast<std::uint16_t>(0xA - settings.filter);  // normal, 2 or 4 times oversampled
    setup.write(accel, accel_conf, static_cast<std::uint16_t>(bandwidth << 4U | accel_rate),
                write_pause_us);
    setup.write(accel, accel_range, 0x03, write_pause_us);  // 24 g
    if (settings.accel_ready) {
        // INT1 is an output, push-pull, active high; the data-ready of the accelerometer is on it.
        setup.write(accel, accel_int1_io_conf, 0x0A, write_pause_us);
        setup.write(accel, accel_int_map_data, 0x04, write_pause_us);
    }

    setup.write(gyro, gyro_soft_reset, soft_reset, 50'000);
    setup.expect(gyro, gyro_chip_id, gyro_id);
    setup.write(gyro, gyro_range, 0x00, write_pause_us);  // 2000 deg/s
    const std::uint8_t code = slowest_not_below(rates, settings.rate_millihertz).code;
    setup.write(gyro, gyro_bandwidth, code, write_pause_us);
    setup.expect(gyro, gyro_bandwidth, static_cast<std::uint16_t>(code | 0x80U));
    setup.write(gyro, gyro_int_io_conf, 0x0D, write_pause_us);  // INT3 push-pull, active high
    setup.write(gyro, gyro_int_io_map, 0x01, write_pause_us);   // data ready to INT3
    setup.write(gyro, gyro_int_ctrl, 0x80, write_pause_us);
}

/// The last reading proves that the accelerometer has not reset itself, which would suspend it.
void Bmi088::reading(unsigned index, ImuTransfer& transfer) const {
    if (index == 0)
        burst(gyro, gyro_chip_id, gyro_burst, transfer);
    else if (index == 1)
        burst(accel, accel_chip_id, accel_burst, transfer);
    else
        burst(accel, accel_pwr_conf, 2, transfer);
}

AccelBytes Bmi088::accel_bytes() const {
    constexpr std::uint8_t first = 2 + accel_data;  // after address and dummy
    return {1, first, first + 6};
}

Verdict Bmi088::parse(const ImuReply* replies, unsigned /*count*/, wire::ImuSample& sample) const {
    const std::uint8_t* rate = replies[0].bytes + 1;
    const std::uint8_t* registers = replies[1].bytes + 2;  // after address and dummy
    for (std::size_t axis = 0; axis < 3; ++axis) {
        sample.gyro[axis] = signed_word(little_endian(rate + 2, axis));
        sample.accel[axis] = signed_word(little_endian(registers + accel_data, axis));
    }
    // 11 bits, left-aligned.
    sample.temperature =
        static_cast<std::int16_t>(signed_word(big_endian(registers + accel_temperature, 0)) >> 5U);
    if (rate[gyro_chip_id] != gyro_id || registers[accel_chip_id] != accel_id)
        sample.flags |= wire::imu_check_failed;
    const std::uint8_t* power = replies[2].bytes + 2;
    if (power[0] != active || power[1] != on) sample.flags |= wire::imu_check_failed;
    if ((registers[accel_error] & error_bits) != 0) sample.flags |= wire::imu_self_test_failed;
    return Verdict::taken;
}

}  // namespace versavis::firmware
