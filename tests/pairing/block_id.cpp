// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/block_id.hpp"

#include <catch2/catch.hpp>

using versavis::pairing::BlockIdUnwrapper;

TEST_CASE("block_id: 16-bit ids go on after 65535, without a zero") {
    BlockIdUnwrapper ids;
    std::uint64_t expected = 0;
    for (int lap = 0; lap < 3; ++lap)
        for (std::uint64_t id = 1; id <= 65535; ++id) REQUIRE(ids.unwrap(id) == ++expected);
}

TEST_CASE("block_id: gaps over the wrap, late ones and any first number") {
    BlockIdUnwrapper ids;
    CHECK(ids.unwrap(65530) == 65530);
    CHECK(ids.unwrap(3) == 65538);
    CHECK(ids.unwrap(65535) == 65535);
    CHECK(ids.unwrap(4) == 65539);
}

TEST_CASE("block_id: long ids stay as they are") {
    BlockIdUnwrapper ids;
    for (const std::uint64_t id : {65534ULL, 65535ULL, 65536ULL, 65537ULL, 1ULL << 40U})
        CHECK(ids.unwrap(id) == id);
    CHECK(ids.unwrap(1) == 1);  // begun anew, not wrapped
}

TEST_CASE("block_id: half a lap either way is the way it went") {
    for (const std::uint64_t last : {1U, 1'000U, 40'000U, 65'535U}) {
        BlockIdUnwrapper ids;
        for (std::uint64_t id = 1; id <= 65'535; ++id) ids.unwrap(id);
        const std::uint64_t now = 65'535 + last;
        for (std::uint64_t id = 1; id <= last; ++id) ids.unwrap(id);
        for (const std::uint64_t step : {1U, 2U, 32'766U, 32'767U}) {
            BlockIdUnwrapper forward = ids;
            CHECK(forward.unwrap((now + step - 1) % 65'535 + 1) == now + step);
        }
        for (const std::uint64_t step : {1U, 2U, 32'766U, 32'767U}) {
            BlockIdUnwrapper back = ids;
            CHECK(back.unwrap((now - step - 1) % 65'535 + 1) == now - step);
            CHECK(back.unwrap((now - 1) % 65'535 + 1) == now);
        }
    }
}

TEST_CASE("block_id: the first number may be any, and 65536 ends all wraps") {
    for (const std::uint64_t first : {0U, 1U, 40'000U, 65'535U}) {
        BlockIdUnwrapper ids;
        CHECK(ids.unwrap(first) == first);
    }
    BlockIdUnwrapper ids;
    CHECK(ids.unwrap(65'536) == 65'536);
    CHECK(ids.unwrap(3) == 3);
    CHECK(ids.unwrap(70'000) == 70'000);
}

TEST_CASE("block_id: less than half a lap back is late, more is the next lap") {
    for (const auto& [id, expected] :
         {std::pair{13'000U, 13'000U}, {10'000U, 10'000U}, {7'300U, 7'300U}, {7'000U, 72'535U}}) {
        BlockIdUnwrapper ids;
        ids.unwrap(40'000);
        CHECK(ids.unwrap(id) == expected);
    }
    BlockIdUnwrapper ids;
    ids.unwrap(5);
    CHECK(ids.unwrap(65'535) == 0);  // the one before the first
}
