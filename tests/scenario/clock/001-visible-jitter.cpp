// SPDX-License-Identifier: BSD-3-Clause
// 1 Hz, +-5 ms that the round trip shows.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 001: jitter that the round trip shows") {
    Settings settings;
    settings.exchange_hz = 1;
    settings.link = [](Random&) { return visible_jitter(); };
    Score result = score<clock::EnvelopeFilter>(settings, 32);
    CHECK(result.p99_us() <= 240);
    check_honest(result);
}
