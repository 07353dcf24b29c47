// SPDX-License-Identifier: BSD-3-Clause
#include "imu_device.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "imu_sampler.hpp"
#include "native_board.hpp"
#include "versavis/imu/imu_model.hpp"

using namespace versavis;

TEST_CASE("imu_device: what the sampler reads of it is the motion, with a valid CRC") {
    const rig::Motion motion(HostTime{0});
    const rig::ImuDevice device(motion);
    const HostTime at{250'000'000};
    std::vector<std::uint8_t> transmit(firmware::adis16448::burst_bytes);
    std::vector<std::uint8_t> received(transmit.size());
    transmit[0] = firmware::adis16448::burst_command;
    device.burst(at, transmit, received);
    const std::uint8_t* words = received.data() + 2;
    CHECK((words[24] << 8 | words[25]) == firmware::adis16448::burst_crc(words));
    const auto gyro = static_cast<std::int16_t>(words[2] << 8 | words[3]);
    const double lsb = imu::find_model("adis16448b")->gyro_rad_s;
    CHECK(gyro * lsb == Approx(motion.pitch_rate_rad_s(at)).margin(lsb));
    transmit[0] = 0;
    device.burst(at, transmit, received);
    CHECK(received == std::vector<std::uint8_t>(received.size()));
}
