// SPDX-License-Identifier: BSD-3-Clause
#include "engine/rounding.hpp"

#include <catch2/catch.hpp>
#include <cmath>

using namespace versavis;

TEST_CASE("rounding: what is rounded fits, and leaves room for sums") {
    CHECK(rounded(2.6) == nanoseconds(3));
    CHECK(rounded(-2.6) == nanoseconds(-3));
    constexpr Duration limit = nanoseconds(std::int64_t{1} << 60);
    CHECK(rounded(0x1p60) == limit);
    CHECK(rounded(1e30) == limit);
    CHECK(rounded(-INFINITY) == -limit);
    CHECK(rounded(NAN) == -limit);
}
