// SPDX-License-Identifier: BSD-3-Clause
// 1 Hz, +-5 ms in round trips that are all alike.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 002: jitter that the round trip does not show") {
    Settings settings;
    settings.exchange_hz = 1;
    settings.link = [](Random&) { return invisible_jitter(); };
    Score result = score<clock::EnvelopeFilter>(settings, 32);
    CHECK(result.p99_us() <= 390);
    check_honest(result);
}
