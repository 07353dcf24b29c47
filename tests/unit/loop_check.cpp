// SPDX-License-Identifier: BSD-3-Clause
#include "board/loop_check.hpp"

#include <catch2/catch.hpp>
#include <functional>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

constexpr SentPulses sent_pulses{milliseconds(10), milliseconds(1), 20};
constexpr std::int64_t pulse_period = 10'000'000;
constexpr std::int64_t pulse_width = 1'000'000;
constexpr std::int64_t first_pulse = 1'234 * pulse_period;

/// 21 pulses; the falling edges are of later pulses.
SeenEdges good(std::int64_t late_rise = 0, std::int64_t late_fall = 0) {
    SeenEdges seen;
    for (std::int64_t i = 0; i < 21; ++i) {
        seen.rising_ns.push_back(first_pulse + i * pulse_period + late_rise);
        seen.falling_ns.push_back(first_pulse + (i + 50) * pulse_period + pulse_width + late_fall);
    }
    return seen;
}

}  // namespace

TEST_CASE("loop_check: a wire passes on period and width") {
    const LoopFinding finding = check_loop(sent_pulses, good(100, 300));
    CHECK(finding.result == LoopResult::ok);
    CHECK(finding.period.ns == pulse_period);
    CHECK(finding.width.ns == pulse_width + 200);
    CHECK(finding.hint.empty());
}

TEST_CASE("loop_check: an input that hears something else is open") {
    CHECK(check_loop(sent_pulses, {}).result == LoopResult::open);
    SeenEdges hum;  // 50 Hz, not locked to the board
    for (std::int64_t i = 0; i < 40; ++i) hum.rising_ns.push_back(i * 20'013'000 / 2);
    CHECK(check_loop(sent_pulses, hum).result == LoopResult::open);
    SeenEdges few = good();
    few.rising_ns.resize(9);
    CHECK(check_loop(sent_pulses, few).result == LoopResult::open);
}

TEST_CASE("loop_check: what is wrong with a line is reported with what to check") {
    struct Case {
        const char* name;
        std::function<void(SeenEdges&)> spoil;
        const char* hint;
    };
    const Case wrong = GENERATE(values<Case>({
        {"a pulse is missing",
         [](SeenEdges& seen) { seen.rising_ns.erase(seen.rising_ns.begin() + 7); },
         "41 of 42 edges arrived: check the wire's contacts"},
        {"no falling edges", [](SeenEdges& seen) { seen.falling_ns.clear(); },
         "21 of 40 edges arrived"},
        {"noise",
         [](SeenEdges& seen) {
             seen.rising_ns.insert(seen.rising_ns.begin() + 4,
                                   first_pulse + 3 * pulse_period + 250'000);
         },
         "1 edges more than were sent: check ground"},
        {"inverted",
         [](SeenEdges& seen) {
             const auto late = good(pulse_width, -pulse_width);
             seen = late;
         },
         "the line is inverted"},
        {"both late", [](SeenEdges& seen) { seen = good(25'000, 25'000); },
         "pulses begin 25.0 us after"},
        {"slow to fall", [](SeenEdges& seen) { seen = good(0, 40'000); },
         "pulses are 1040.0 us wide, 1000.0 us were sent"},
    }));
    INFO(wrong.name);
    SeenEdges seen = good();
    wrong.spoil(seen);
    const LoopFinding finding = check_loop(sent_pulses, seen);
    CHECK(finding.result == LoopResult::failed);
    CHECK_THAT(finding.hint, Contains(wrong.hint));
}

TEST_CASE("loop_check: the tolerance is that of isolators, to either side") {
    CHECK(check_loop(sent_pulses, good(9'900, 9'900)).result == LoopResult::ok);
    CHECK(check_loop(sent_pulses, good(-9'900, -9'900)).result == LoopResult::ok);
    CHECK(check_loop(sent_pulses, good(10'100, 10'100)).result == LoopResult::failed);
    CHECK(check_loop(sent_pulses, good(0, -10'100)).result == LoopResult::failed);
}
