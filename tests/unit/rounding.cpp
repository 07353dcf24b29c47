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

TEST_CASE("rounding: the nearest second may lie before or after, on either side of zero") {
    CHECK(past_nearest_second_ns(7'000'000'003) == 3);
    CHECK(past_nearest_second_ns(6'999'999'997) == -3);
    CHECK(past_nearest_second_ns(-7'000'000'003) == -3);
    CHECK(past_nearest_second_ns(-6'999'999'997) == 3);
    CHECK(past_nearest_second_ns(499'999'999) == 499'999'999);
    CHECK(past_nearest_second_ns(500'000'000) == -500'000'000);
    CHECK(past_nearest_second_ns(INT64_MAX) == -145'224'193);
    CHECK(past_nearest_second_ns(INT64_MIN) == 145'224'192);
}
