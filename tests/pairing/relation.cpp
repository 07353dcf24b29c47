// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/relation.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>

using versavis::pairing::Relation;

namespace {

constexpr std::int64_t period_ns = 50'000'000;

}

TEST_CASE("relation: drift is learned, and predicts through an outage") {
    Relation clock(true);
    std::int64_t instant = 0;
    const auto frame = [&] { return 7'000'000'000 + instant + instant / 10'000; };  // 100 ppm
    for (int i = 0; i < 600; ++i, instant += period_ns) clock.track(frame(), instant);
    instant += 3'000'000'000;
    CHECK(std::abs(clock.expected_instant_ns(frame()) - instant) < 20'000);
    CHECK(clock.tolerance_ns(instant) < 200'000);
}

TEST_CASE("relation: a step is followed at once, without losing the drift") {
    Relation clock(true);
    std::int64_t instant = 0;
    std::int64_t offset = 0;
    const auto frame = [&] { return offset + instant + instant / 20'000; };
    for (int i = 0; i < 600; ++i, instant += period_ns) clock.track(frame(), instant);
    offset = -5'000'000'000;
    clock.move(frame(), instant);
    instant += 1'000'000'000;
    CHECK(std::abs(clock.expected_instant_ns(frame()) - instant) < 10'000);
}

TEST_CASE("relation: a late frame moves a delay by little, an early one by more") {
    Relation latency(false);
    for (int i = 0; i < 200; ++i) latency.track(i * period_ns + 3'000'000, i * period_ns);
    latency.track(200 * period_ns + 43'000'000, 200 * period_ns);
    CHECK(latency.expected_instant_ns(300 * period_ns + 3'000'000) ==
          Approx(300 * period_ns).margin(300'000));
    CHECK(latency.deviation_ns() < 500'000);
    for (int i = 201; i < 260; ++i) latency.track(i * period_ns + 2'000'000, i * period_ns);
    CHECK(latency.expected_instant_ns(300 * period_ns + 2'000'000) ==
          Approx(300 * period_ns).margin(100'000));
}

TEST_CASE("relation: what it expects and tolerates, from its first pair on") {
    Relation relation(true);
    CHECK_FALSE(relation.known());
    relation.track(1'000'500, 1'000'000);
    CHECK(relation.known());
    CHECK(relation.difference_ns() == 500);
    CHECK(relation.deviation_ns() == 0);
    CHECK(relation.expected_instant_ns(2'000'500) == 2'000'000);
    CHECK(relation.tolerance_ns(1'000'000) == 30'000);
    // Two crystals of 100 ppm, and some, either way.
    CHECK(relation.tolerance_ns(1'000'000 + 1'000'000'000) == 30'000 + 250'000);
    CHECK(relation.tolerance_ns(1'000'000 - 1'000'000'000) == 30'000 + 250'000);
    // A surprise: a quarter goes into the difference, a sixteenth into the deviation.
    relation.track(1'001'000'500 + 16'000, 1'001'000'000);
    CHECK(relation.difference_ns() == 500 + 4'000);
    CHECK(relation.deviation_ns() == 1'000);
    CHECK(relation.tolerance_ns(1'001'000'000) == 30'000 + 5'000);
    relation.move(5'000'000'000, 2'001'000'000);
    CHECK(relation.difference_ns() == 2'999'000'000);
    CHECK(relation.deviation_ns() == 1'000);
}

TEST_CASE("relation: a rate is learned by and by, within limits, and trusted after ten seconds") {
    constexpr std::int64_t second = 1'000'000'000;
    Relation relation(true);
    relation.track(0, 0);
    // At most a twentieth of a surprise is rate: 20 us in a second are 1 ppm then.
    relation.track(second + 20'000, second);
    CHECK(relation.expected_instant_ns(second + relation.difference_ns() + second) ==
          second + second - 1'000);
    Relation quick(true);
    quick.track(0, 0);
    quick.track(second / 10 + 20'000, second / 10);
    // 0.2 a second, for a tenth of one: 0.4 us in a tenth, which are 4 ppm.
    CHECK(quick.expected_instant_ns(second / 10 + quick.difference_ns() + second) ==
          second / 10 + second - 4'000);
    Relation wild(true);
    wild.track(0, 0);
    for (std::int64_t i = 1; i < 200; ++i) wild.track(i * second * 2, i * second);
    CHECK(wild.expected_instant_ns(199 * second + wild.difference_ns() + second) ==
          200 * second - 500'000);
    Relation settled(true);
    settled.track(0, 0);
    settled.track(10 * second, 10 * second);
    CHECK(settled.tolerance_ns(11 * second) == 30'000 + 250'000);
    settled.track(10 * second + 1, 10 * second + 1);
    CHECK(settled.tolerance_ns(11 * second + 1) == 30'000 + 20'000);
}

TEST_CASE("relation: a delay has no rate, and late frames count less than early ones") {
    Relation delay(false);
    delay.track(1'000'000, 0);
    CHECK(delay.tolerance_ns(1'000'000'000'000) == 30'000);
    delay.track(100'000'000 + 1'000'000 + 160'000, 100'000'000);
    CHECK(delay.difference_ns() == 1'010'000);
    CHECK(delay.deviation_ns() == 10'000);
    delay.track(200'000'000 + 1'010'000 - 160'000, 200'000'000);
    CHECK(delay.difference_ns() == 990'000);
    CHECK(delay.deviation_ns() == 10'000 + 150'000 / 16);
    // One that is far too late is cut at 2 ms and two deviations.
    Relation cut(false);
    cut.track(0, 0);
    cut.track(900'000'000, 100'000'000);
    CHECK(cut.difference_ns() == 125'000);
    CHECK(cut.deviation_ns() == 125'000);
    cut.track(900'000'000, 200'000'000);
    CHECK(cut.difference_ns() == 125'000 + 2'250'000 / 16);
}

TEST_CASE("relation: ten seconds count from its first pair, whenever that was") {
    constexpr std::int64_t hour = 3'600'000'000'000;
    Relation clock(true);
    std::int64_t instant = hour;
    for (; instant <= hour + 9'000'000'000; instant += period_ns) clock.track(instant, instant);
    const std::int64_t before = clock.tolerance_ns(instant + 1'000'000'000);
    for (; instant <= hour + 11'000'000'000; instant += period_ns) clock.track(instant, instant);
    const std::int64_t after = clock.tolerance_ns(instant + 1'000'000'000);
    CHECK(before > 250'000);
    CHECK(after < 60'000);
}

TEST_CASE("relation: a steady rate leaves nothing to be surprised by") {
    Relation clock(true);
    std::int64_t instant = 0;
    const auto frame = [&] { return instant + instant / 5'000; };  // 200 ppm
    for (int i = 0; i < 400; ++i, instant += 1'000'000'000) clock.track(frame(), instant);
    CHECK(std::abs(clock.expected_instant_ns(frame()) - instant) < 100);
    CHECK(clock.deviation_ns() < 100);
}
