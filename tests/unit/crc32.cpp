// SPDX-License-Identifier: BSD-3-Clause
#include "wire/crc32.hpp"

#include <rapidcheck.h>

#include <boost/crc.hpp>
#include <catch2/catch.hpp>
#include <vector>

using versavis::wire::crc32;

TEST_CASE("crc32: the check value of CRC-32/ISO-HDLC") {
    const std::uint8_t text[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
    CHECK(crc32(text, sizeof text) == 0xCBF43926U);
    CHECK(crc32(text, 0) == 0);
}

TEST_CASE("crc32: agrees with Boost on any bytes") {
    CHECK(rc::check([](const std::vector<std::uint8_t>& bytes) {
        boost::crc_32_type reference;
        reference.process_bytes(bytes.data(), bytes.size());
        RC_ASSERT(crc32(bytes.data(), bytes.size()) == reference.checksum());
    }));
}
