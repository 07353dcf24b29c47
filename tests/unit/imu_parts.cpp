// SPDX-License-Identifier: BSD-3-Clause
// Arithmetic of the IMU drivers against vectors of the makers.
#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "imu/adis.hpp"
#include "imu/imu_part.hpp"
#include "imu/vn100.hpp"

using namespace versavis;
using namespace versavis::firmware;

TEST_CASE("imu_parts: the CRC of an ADIS16448B's burst is that of the maker's example") {
    const std::uint16_t words[] = {0x000F, 0xFFF8, 0x000A, 0xFE41, 0xFFCC, 0x0456,
                                   0x0227, 0xFDA3, 0xF412, 0xC13C, 0xFF6C};
    CHECK(adis16448_crc(words) == 0x9AF4);
    const std::uint16_t zeros[11] = {};
    CHECK(adis16448_crc(zeros) != 0);  // a dead bus does not pass
}

TEST_CASE("imu_parts: the CRC of a VN-100's packet is that of the manual's example") {
    std::vector<std::uint8_t> packet{0xFA, 0x01, 0x08, 0x00, 0x93, 0x50, 0x2E, 0x42, 0x83,
                                     0x3E, 0xF1, 0x3F, 0x48, 0xB5, 0x04, 0xBB, 0x92, 0x88};
    CHECK(vn100_crc(packet.data() + 1, packet.size() - 1) == 0);
    packet[7] ^= 1U;
    CHECK(vn100_crc(packet.data() + 1, packet.size() - 1) != 0);
}

TEST_CASE("imu_parts: floats become fixed point without floating point") {
    const auto fixed = [](float value, unsigned bits) {
        std::uint32_t word = 0;
        std::memcpy(&word, &value, sizeof word);
        std::int32_t out = 0;
        REQUIRE(fixed_point(word, bits, out));
        return out;
    };
    CHECK(fixed(0.0F, 20) == 0);
    CHECK(fixed(1.0F, 20) == 1 << 20);
    CHECK(fixed(-9.81F, 20) == Approx(-9.81 * (1 << 20)).margin(1));
    CHECK(fixed(1e-30F, 20) == 0);
    CHECK(fixed(-3e30F, 20) == -INT32_MAX);
    CHECK(fixed(100.0F, 20) == 100 << 20);
    std::int32_t out = 0;
    CHECK_FALSE(fixed_point(0x7FC00000U, 20, out));  // no number
    CHECK_FALSE(fixed_point(0x7F800000U, 20, out));  // infinite
}

TEST_CASE(
    "imu_parts: rates are those that the parts have, never slower than asked unless none is "
    "faster") {
    const auto rate = [](wire::ImuKind kind, std::uint32_t millihertz) {
        return find_part(kind)->rate(millihertz);
    };
    CHECK(rate(wire::ImuKind::adis16448b, 200'000) == 204'800);
    CHECK(rate(wire::ImuKind::adis16448b, 204'800) == 204'800);
    CHECK(rate(wire::ImuKind::adis16448b, 204'801) == 409'600);
    CHECK(rate(wire::ImuKind::adis16448b, 900'000) == 819'200);
    CHECK(rate(wire::ImuKind::adis16460, 600'000) == 682'666);
    CHECK(rate(wire::ImuKind::adis16470, 2'000'000) == 2'000'000);
    CHECK(rate(wire::ImuKind::adis16470, 1'000) == 1'000);
    CHECK(rate(wire::ImuKind::icm42688p, 201'000) == 500'000);
    CHECK(rate(wire::ImuKind::icm42688p, 1) == 12'500);
    CHECK(rate(wire::ImuKind::bmi088, 150'000) == 200'000);
    CHECK(Vn100::true_rate(300'000) == 400'000);
    CHECK(Vn100::true_rate(800'000) == 800'000);
    // A rate that a part has is kept: the answer of a configuration can be sent again.
    for (std::uint32_t wanted = 1'000; wanted < 2'000'000; wanted += 777)
        for (const auto kind :
             {wire::ImuKind::adis16445, wire::ImuKind::adis16460, wire::ImuKind::adis16470})
            REQUIRE(rate(kind, rate(kind, wanted)) == rate(kind, wanted));
}

TEST_CASE("imu_parts: a BMI088 shows its accelerometer's data-ready only when that is wired") {
    const ImuPart& part = *find_part(wire::ImuKind::bmi088);
    const auto writes = [&part](bool accel_ready, std::uint8_t address) {
        Setup setup;
        part.setup({1'000'000, 0, accel_ready}, setup);
        REQUIRE(setup.size() < Setup::capacity);  // nothing was left out
        for (std::size_t i = 0; i < setup.size(); ++i)
            if (setup[i].chip == 1 && setup[i].address == address) return int{setup[i].value};
        return -1;
    };
    CHECK(writes(false, 0x53) == -1);
    CHECK(writes(false, 0x58) == -1);
    CHECK(writes(true, 0x53) == 0x0A);
    CHECK(writes(true, 0x58) == 0x04);
}
