// SPDX-License-Identifier: BSD-3-Clause
#include "wire/cobs.hpp"

#include <rapidcheck.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <vector>

using namespace versavis;
using Bytes = std::vector<std::uint8_t>;

namespace {

Bytes encode(const Bytes& data) {
    Bytes out(wire::cobs_bound(data.size()));
    out.resize(wire::cobs_encode(data.data(), data.size(), out.data()));
    Bytes in_place(wire::cobs_bound(data.size()));
    std::copy(data.rbegin(), data.rend(), in_place.rbegin());
    const std::uint8_t* const from = in_place.data() + in_place.size() - data.size();
    in_place.resize(wire::cobs_encode(from, data.size(), in_place.data()));
    CHECK(in_place == out);
    return out;
}

Bytes decode(const Bytes& data) {
    Bytes out(data.size() + 1);
    const std::size_t size = wire::cobs_decode(data.data(), data.size(), out.data(), out.size());
    REQUIRE(size != wire::cobs_invalid);
    out.resize(size);
    return out;
}

}  // namespace

TEST_CASE("cobs: examples of the paper") {
    CHECK(encode({}) == Bytes{1});
    CHECK(encode({0}) == Bytes{1, 1});
    CHECK(encode({0, 0}) == Bytes{1, 1, 1});
    CHECK(encode({0x11, 0x22, 0, 0x33}) == Bytes{3, 0x11, 0x22, 2, 0x33});
    CHECK(encode({0x11, 0, 0, 0}) == Bytes{2, 0x11, 1, 1, 1});
}

TEST_CASE("cobs: blocks of 253, 254 and 255 bytes without zero") {
    for (const std::size_t size : {253U, 254U, 255U, 508U, 509U}) {
        Bytes data(size, 7);
        CHECK(decode(encode(data)) == data);
        CHECK(encode(data).size() <= wire::cobs_bound(size));
        data.push_back(0);
        CHECK(decode(encode(data)) == data);
    }
}

TEST_CASE("cobs: what is encoded has no zero and decodes to itself") {
    CHECK(rc::check([](const Bytes& small) {
        Bytes data;
        for (const std::uint8_t byte : small) data.insert(data.end(), 1 + byte % 60, byte % 3);
        const Bytes encoded = encode(data);
        RC_ASSERT(std::count(encoded.begin(), encoded.end(), 0) == 0);
        RC_ASSERT(decode(encoded) == data);
    }));
}

TEST_CASE("cobs: malformed input is refused") {
    Bytes out(8);
    const Bytes zero_code{0};
    const Bytes cut{5, 1, 2};
    const Bytes zero_inside{3, 0, 1};
    const Bytes long_one(20, 1);
    CHECK(wire::cobs_decode(zero_code.data(), zero_code.size(), out.data(), out.size()) ==
          wire::cobs_invalid);
    CHECK(wire::cobs_decode(cut.data(), cut.size(), out.data(), out.size()) == wire::cobs_invalid);
    CHECK(wire::cobs_decode(zero_inside.data(), zero_inside.size(), out.data(), out.size()) ==
          wire::cobs_invalid);
    CHECK(wire::cobs_decode(long_one.data(), long_one.size(), out.data(), out.size()) ==
          wire::cobs_invalid);
}
