// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/clock/output_clock.hpp"

#include <catch2/catch.hpp>
#include <ctime>

using namespace versavis;
using namespace versavis::clock;

TEST_CASE("output_clock: realtime is host time plus the offset") {
    auto clock = OutputClock::create(OutputClockKind::realtime);
    REQUIRE(clock);
    const Duration offset = clock->offset();
    timespec before{};
    timespec after{};
    clock_gettime(CLOCK_REALTIME, &before);
    const std::int64_t translated = host_now().ns + offset.ns;
    clock_gettime(CLOCK_REALTIME, &after);
    const auto ns = [](const timespec& t) { return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec; };
    CHECK(translated > ns(before) - 100'000);
    CHECK(translated < ns(after) + 100'000);
    CHECK(clock->steps() == 0);
}

TEST_CASE("output_clock: monotonic_raw is the host clock itself") {
    auto clock = OutputClock::create(OutputClockKind::monotonic_raw);
    REQUIRE(clock);
    CHECK(clock->offset().ns == 0);
}
