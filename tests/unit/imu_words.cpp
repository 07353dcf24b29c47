// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_words.hpp"

#include <catch2/catch.hpp>

using namespace versavis::firmware;

TEST_CASE("imu_words: words of two bytes, the high or the low one first") {
    const std::uint8_t bytes[] = {0x01, 0x02, 0x83, 0x04, 0xFF, 0xFE};
    CHECK(big_endian(bytes, 0) == 0x0102);
    CHECK(big_endian(bytes, 1) == 0x8304);
    CHECK(big_endian(bytes, 2) == 0xFFFE);
    CHECK(little_endian(bytes, 0) == 0x0201);
    CHECK(little_endian(bytes, 1) == 0x0483);
    CHECK(little_endian(bytes, 2) == 0xFEFF);
    CHECK(signed_word(0xFFFE) == -2);
    CHECK(signed_word(0x8000) == -32768);
    CHECK(signed_word(0x7FFF) == 32767);
}

TEST_CASE("imu_words: of a table of rates, the slowest that is fast enough, else the fastest") {
    constexpr RateCode rates[] = {{400, 7}, {200, 5}, {50, 9}};
    const auto [wanted, found, code] = GENERATE(table<unsigned, unsigned, int>({{0, 50, 9},
                                                                                {50, 50, 9},
                                                                                {51, 200, 5},
                                                                                {200, 200, 5},
                                                                                {201, 400, 7},
                                                                                {400, 400, 7},
                                                                                {401, 400, 7}}));
    CHECK(slowest_not_below(rates, wanted).millihertz == found);
    CHECK(slowest_not_below(rates, wanted).code == code);
    constexpr RateCode one[] = {{400, 7}};
    CHECK(slowest_not_below(one, 1).code == 7);
}
