// SPDX-License-Identifier: BSD-3-Clause
#include "engine/plausibility/delay_floor.hpp"

#include <catch2/catch.hpp>

using namespace versavis;

namespace {

constexpr Duration good_clock = microseconds(5);

/// Messages that took 300 us, one each millisecond.
struct DelayBench {
    void learn(int messages, Duration delay) {
        for (int i = 0; i < messages; ++i) floor.learn(delay, now = now + milliseconds(1));
    }
    Promptness of(Duration delay, Duration sigma = good_clock) const {
        return floor.of(delay, sigma);
    }

    DelayFloor floor;
    HostTime now{1'000'000'000};
};

}  // namespace

TEST_CASE("delay_floor: few messages, or a bad clock, decide nothing") {
    DelayBench bench;
    bench.learn(15, microseconds(300));
    CHECK(bench.of(seconds(5)) == Promptness::unknown);
    bench.learn(1, microseconds(300));
    CHECK(bench.of(seconds(5)) == Promptness::late);
    CHECK(bench.of(microseconds(300), microseconds(40)) == Promptness::unknown);
    CHECK(bench.of(microseconds(79), microseconds(40)) == Promptness::early);
    // It tells apart what is far apart.
    const auto of = [&](Duration delay, Duration apart) {
        return bench.floor.of(delay, microseconds(40), tolerance_between(apart));
    };
    CHECK(of(microseconds(300), microseconds(479)) == Promptness::unknown);
    CHECK(of(microseconds(300), -milliseconds(5)) == Promptness::usual);
    CHECK(of(microseconds(1671), milliseconds(5)) == Promptness::late);
    CHECK(of(-microseconds(1071), milliseconds(5)) == Promptness::early);
    bench.floor.forget();
    CHECK(bench.of(seconds(5)) == Promptness::unknown);
}

TEST_CASE("delay_floor: the shortest delay counts, however many are longer") {
    DelayBench bench;
    bench.learn(20, milliseconds(3));
    bench.learn(1, microseconds(300));
    bench.learn(20, milliseconds(3));
    CHECK(bench.of(microseconds(400)) == Promptness::usual);
    CHECK(bench.of(microseconds(450)) == Promptness::late);
    CHECK(bench.of(microseconds(200)) == Promptness::usual);
    CHECK(bench.of(microseconds(150)) == Promptness::early);
    CHECK(bench.of(microseconds(450), microseconds(30)) == Promptness::usual);
}

TEST_CASE("delay_floor: a link that stays slower is followed, a silence is not") {
    DelayBench bench;
    bench.learn(20, microseconds(300));
    bench.learn(30'000, microseconds(500));
    CHECK(bench.of(microseconds(500)) == Promptness::late);
    bench.learn(70'000, microseconds(500));
    CHECK(bench.of(microseconds(500)) == Promptness::usual);
    bench.now = bench.now + seconds(86'400);
    bench.learn(1, microseconds(500));
    CHECK(bench.of(microseconds(370)) == Promptness::early);
}

TEST_CASE("delay_floor: only what is larger than its tolerance is confirmed by a usual delay") {
    CHECK(arrival_confirms(Promptness::usual, milliseconds(1)));
    CHECK(arrival_confirms(Promptness::usual, -milliseconds(1)));
    CHECK_FALSE(arrival_confirms(Promptness::usual, microseconds(400)));
    for (const Promptness other :
         {Promptness::not_recorded, Promptness::unknown, Promptness::early, Promptness::late})
        CHECK_FALSE(arrival_confirms(other, seconds(1)));
}

TEST_CASE("delay_floor: after a step of the clock, more delays seem early than usual") {
    DelayBench bench;
    bench.learn(20, microseconds(300));
    for (const Duration step : {microseconds(800), milliseconds(5), milliseconds(50)}) {
        const Duration tolerance = tolerance_between(step);
        const Duration sigma = tolerance / 3;  // were it worse, none would be usual
        int early = 0;
        int usual = 0;
        // They wait for anything up to twice the step, as on a link with long delays.
        for (int i = 0; i < 200; ++i) {
            const Duration delay = microseconds(300) + step * i / 100 - step;
            const Promptness promptness = bench.floor.of(delay, sigma, tolerance);
            early += promptness == Promptness::early ? 1 : 0;
            usual += promptness == Promptness::usual ? 1 : 0;
        }
        CHECK(usual > 0);
        CHECK(early > usual);
    }
}

TEST_CASE("delay_floor: what most of them say counts for a step, early or not") {
    StepPromptness promptness;
    CHECK_FALSE(promptness.mostly_early());
    const auto doubted = [&](int times, Promptness how) {
        for (int i = 0; i < times; ++i) promptness.doubted(how);
    };
    doubted(3, Promptness::early);
    doubted(2, Promptness::usual);
    doubted(100, Promptness::late);
    doubted(100, Promptness::unknown);
    CHECK(promptness.mostly_early());
    doubted(1, Promptness::usual);
    CHECK_FALSE(promptness.mostly_early());
    doubted(10'000, Promptness::early);
    doubted(20, Promptness::usual);
    CHECK_FALSE(promptness.mostly_early());
    doubted(30, Promptness::early);
    promptness.believed();
    CHECK_FALSE(promptness.mostly_early());
}

TEST_CASE("delay_floor: where most of them are late, they must agree for longer") {
    StepPromptness promptness;
    CHECK(promptness.least_to_prevail() == 0);
    for (int i = 0; i < 3; ++i) promptness.doubted(Promptness::late);
    promptness.doubted(Promptness::unknown);
    promptness.doubted(Promptness::usual);
    CHECK(promptness.least_to_prevail() == least_to_prevail);
    promptness.doubted(Promptness::usual);
    promptness.doubted(Promptness::usual);
    CHECK(promptness.least_to_prevail() == 0);
    promptness.doubted(Promptness::late);
    promptness.believed();
    CHECK(promptness.least_to_prevail() == 0);
}
