// SPDX-License-Identifier: BSD-3-Clause
#include "imu/icm42688p.hpp"

#include "imu/imu_words.hpp"

namespace versavis::firmware {

namespace {

enum Register : std::uint8_t {
    device_config = 0x11,
    int_config = 0x14,
    temp_data1 = 0x1D,  // then accelerometer and gyro up to 0x2A, time stamp, INT_STATUS at 0x2D
    pwr_mgmt0 = 0x4E,
    gyro_config0 = 0x4F,
    accel_config0 = 0x50,
    gyro_accel_config0 = 0x52,
    int_config1 = 0x64,
    int_source0 = 0x65,
    who_am_i = 0x75,
};

constexpr std::size_t burst_registers = 17;
constexpr std::size_t status_at = 1 + 16;
constexpr std::uint8_t data_ready = 0x08;
constexpr std::uint8_t both_low_noise = 0x0F;
constexpr std::uint32_t fast_millihertz = 4'000'000;

constexpr RateCode rates[] = {{8'000'000, 3}, {4'000'000, 4}, {2'000'000, 5}, {1'000'000, 6},
                              {500'000, 15},  {200'000, 7},   {100'000, 8},   {50'000, 9},
                              {25'000, 10},   {12'500, 11}};

}  // namespace

std::uint32_t Icm42688p::rate(std::uint32_t wanted_millihertz) const {
    return slowest_not_below(rates, wanted_millihertz).millihertz;
}

void Icm42688p::setup(const PartSettings& settings, Setup& setup) const {
    const std::uint8_t code = slowest_not_below(rates, settings.rate_millihertz).code;
    setup.write(0, device_config, 1, 2'000);  // reset; the sheet asks for 1 ms
    setup.expect(0, who_am_i, identity());
    setup.write(0, int_config, 0x03);  // INT1 pulsed, push-pull, active high
    // Short pulses where the rate requires them; the asynchronous reset bit must be cleared.
    setup.write(0, int_config1, settings.rate_millihertz >= fast_millihertz ? 0x60 : 0x00);
    setup.write(0, int_source0, 0x08);  // data ready only
    setup.write(0, gyro_accel_config0,
                static_cast<std::uint16_t>(settings.filter << 4U | settings.filter));
    setup.write(0, gyro_config0, code);
    setup.write(0, accel_config0, code);
    setup.write(0, pwr_mgmt0, both_low_noise, 50'000);  // the gyro needs 45 ms
    setup.expect(0, pwr_mgmt0, both_low_noise);
}

/// The second reading proves that the part is there and has not reset itself: the ones or zeros of
/// a dead bus look like data, and so does what a part shows while switched off.
void Icm42688p::reading(unsigned index, ImuTransfer& transfer) const {
    if (index == 0)
        burst(0, temp_data1, burst_registers, transfer);
    else
        burst(0, pwr_mgmt0, 1, transfer);
}

Verdict Icm42688p::parse(const ImuReply* replies, unsigned /*count*/,
                         wire::ImuSample& sample) const {
    const std::uint8_t* data = replies[0].bytes + 1;
    sample.temperature = signed_word(big_endian(data, 0));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        sample.accel[axis] = signed_word(big_endian(data, 1 + axis));
        sample.gyro[axis] = signed_word(big_endian(data, 4 + axis));
    }
    if (replies[1].bytes[1] != both_low_noise)
        sample.flags |= wire::imu_check_failed;
    else if ((replies[0].bytes[status_at] & data_ready) == 0)
        sample.flags |= wire::imu_repeated;
    return Verdict::taken;
}

}  // namespace versavis::firmware
