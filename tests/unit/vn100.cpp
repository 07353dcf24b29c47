// SPDX-License-Identifier: BSD-3-Clause
#include "imu/vn100.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

TEST_CASE("vn100: the CRC of a VN-100's packet is that of the manual's example") {
    std::vector<std::uint8_t> packet{0xFA, 0x01, 0x08, 0x00, 0x93, 0x50, 0x2E, 0x42, 0x83,
                                     0x3E, 0xF1, 0x3F, 0x48, 0xB5, 0x04, 0xBB, 0x92, 0x88};
    CHECK(vn100_crc(packet.data() + 1, packet.size() - 1) == 0);
    packet[7] ^= 1U;
    CHECK(vn100_crc(packet.data() + 1, packet.size() - 1) != 0);
}

TEST_CASE("vn100: floats become fixed point without floating point") {
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
