// SPDX-License-Identifier: BSD-3-Clause
// Delays measured between two processes, on a quiet machine and on a loaded one.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 006: measured delays") {
    const std::string trace = GENERATE("pty_idle", "pty_load");
    Settings settings;
    settings.exchange_hz = 20;
    settings.length = seconds(80);
    settings.link = [&](Random& random) {
        return measured(VERSAVIS_TEST_DATA "/clock/" + trace + "_delays.csv", random);
    };
    Score result = score<clock::EnvelopeFilter>(settings, 16, {seconds(20).ns});
    CHECK(result.p99_us() <= 10);
    CHECK(result.nees() < 2);
    CHECK(result.beyond_bound() == 0);
}
