// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/problem.hpp"

#include <catch2/catch.hpp>

using namespace versavis;

TEST_CASE("problem: the end of a key is its unit") {
    CHECK(quantity("exposure_us", 3000) == "3000 us");
    CHECK(quantity("rate_hz", 29.97) == "29.97 Hz");
    CHECK(quantity("max_exposure_us", 1e7) == "10000000 us");
    CHECK(quantity("clock_drift_ppm_per_s", 1) == "1 ppm/s");
    CHECK(quantity("slots", 17) == "17");
    CHECK(unit_of("us").empty());
}

TEST_CASE("problem: a user's text cannot fill the screen or steer it") {
    CHECK(clipped(std::string(80, 'a')) == std::string(80, 'a'));
    CHECK(clipped(std::string(81, 'a')) == std::string(80, 'a') + "...");
    CHECK(clipped(std::string(79, 'a') + "\xC3\xA4") == std::string(79, 'a') + "...");
    const TomlProblem problem{{"a.toml", 3, 4}, "", "", "not a \033[31mcolour\n", "none"};
    CHECK(problem.message() == "a.toml:3:4: not a ?[31mcolour?; none");
}
