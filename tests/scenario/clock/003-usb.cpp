// SPDX-License-Identifier: BSD-3-Clause
// Ten exchanges a second over USB full speed.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 003: exchanges over USB") {
    Score result = score<clock::EnvelopeFilter>(Settings{}, 8);
    CHECK(result.p99_us() <= 16);
    check_honest(result);
}
