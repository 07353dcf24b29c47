// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/relation.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>

using versavis::pairing::Relation;

namespace {

constexpr std::int64_t period = 50'000'000;

}

TEST_CASE("relation: drift is learned, and predicts through an outage") {
    Relation clock(true);
    std::int64_t instant = 0;
    const auto frame = [&] { return 7'000'000'000 + instant + instant / 10'000; };  // 100 ppm
    for (int i = 0; i < 600; ++i, instant += period) clock.track(frame(), instant);
    instant += 3'000'000'000;
    CHECK(std::abs(clock.expected_instant_ns(frame()) - instant) < 20'000);
    CHECK(clock.tolerance_ns(instant) < 200'000);
}

TEST_CASE("relation: a step is followed at once, without losing the drift") {
    Relation clock(true);
    std::int64_t instant = 0;
    std::int64_t offset = 0;
    const auto frame = [&] { return offset + instant + instant / 20'000; };
    for (int i = 0; i < 600; ++i, instant += period) clock.track(frame(), instant);
    offset = -5'000'000'000;
    clock.move(frame(), instant);
    instant += 1'000'000'000;
    CHECK(std::abs(clock.expected_instant_ns(frame()) - instant) < 10'000);
}

TEST_CASE("relation: a late frame moves a delay by little, an early one by more") {
    Relation latency(false);
    for (int i = 0; i < 200; ++i) latency.track(i * period + 3'000'000, i * period);
    latency.track(200 * period + 43'000'000, 200 * period);
    CHECK(latency.expected_instant_ns(300 * period + 3'000'000) ==
          Approx(300 * period).margin(300'000));
    CHECK(latency.deviation_ns() < 500'000);
    for (int i = 201; i < 260; ++i) latency.track(i * period + 2'000'000, i * period);
    CHECK(latency.expected_instant_ns(300 * period + 2'000'000) ==
          Approx(300 * period).margin(100'000));
}
