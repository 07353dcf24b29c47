// SPDX-License-Identifier: BSD-3-Clause
#include "health/clock_step_detector.hpp"

#include <catch2/catch.hpp>

#include "simulated_clocks.hpp"

using namespace versavis;
using namespace versavis::clock;

TEST_CASE("clock_step_detector: a step is reported once, with the offset before and after") {
    const auto clocks = std::make_shared<test::SimulatedClocks>();
    Translator translator{*OutputClock::create(OutputClockKind::realtime, false, clocks)};
    daemon::ClockStepDetector watch;
    CHECK_FALSE(watch.see(translator.report()));
    const Duration before = translator.report().output_minus_host;
    clocks->pass(milliseconds(500));
    CHECK_FALSE(watch.see(translator.report()));
    clocks->step(-seconds(3));
    const auto step = watch.see(translator.report());
    REQUIRE(step);
    CHECK(absolute(step->before - before) < microseconds(1));
    CHECK(absolute(step->after - step->before + seconds(3)) < microseconds(1));
    CHECK_FALSE(watch.see(translator.report()));
}
