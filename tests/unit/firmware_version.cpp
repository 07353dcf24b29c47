// SPDX-License-Identifier: BSD-3-Clause
#include "engine/board/firmware_version.hpp"

#include <catch2/catch.hpp>

using versavis::board::is_older;

TEST_CASE("firmware_version: numbers are compared as numbers, the first one first") {
    CHECK(is_older("versavis 0.1.0", "0.1.1"));
    CHECK(is_older("versavis 0.9.9", "0.10.0"));
    CHECK(is_older("versavis 1.99.99", "2.0.0"));
    CHECK_FALSE(is_older("versavis 0.1.0", "0.1.0"));
    CHECK_FALSE(is_older("versavis 0.10.0", "0.9.9"));
    CHECK_FALSE(is_older("versavis 2.0.0", "1.99.99"));
}

TEST_CASE("firmware_version: of what is no version nothing is claimed") {
    for (const char* firmware : {"", "versavis", "versavis ", "versavis 1", "versavis 1.2",
                                 "versavis 1.2.x", "versavis x.2.3", "0.0.1", "versavis -1.0.0"})
        CHECK_FALSE(is_older(firmware, "9.9.9"));
    CHECK_FALSE(is_older("versavis 0.0.1", "unknown"));
    CHECK(is_older("versavis 0.0.1-rc1", "9.9.9"));
}
