// SPDX-License-Identifier: BSD-3-Clause
#include "candidate_pulse_train.hpp"

#include <catch2/catch.hpp>

#include "nanoseconds.hpp"

using namespace versavis::firmware;
using namespace versavis::test;

namespace {}

TEST_CASE("candidate_pulse_train: three pulses whole periods apart agree, over short gaps") {
    CandidatePulseTrain rival;
    CHECK_FALSE(rival.add(second, second, 5'000));
    CHECK_FALSE(rival.add(2 * second, second, 5'000));
    CHECK(rival.add(6 * second, second, 5'000));
    CHECK(rival.first() == second);
    CHECK(rival.newest() == 6 * second);
    CHECK(rival.periods() == 5);
    CHECK(rival.add(7 * second, second, 5'000));
    rival.clear();
    CHECK_FALSE(rival.add(8 * second, second, 5'000));
    CHECK_FALSE(rival.add(9 * second, second, 5'000));
    CHECK(rival.add(10 * second, second, 5'000));
    CHECK(rival.first() == 8 * second);
}

TEST_CASE("candidate_pulse_train: pulses agree up to the tolerance of the time between them") {
    const Nanoseconds sign = GENERATE(1, -1);
    const Nanoseconds periods = GENERATE(1, 4);
    CAPTURE(sign, periods);
    const Nanoseconds furthest = periods * (second + sign * 200'000);
    for (const Nanoseconds beyond : {0, 1}) {
        CandidatePulseTrain rival;
        CHECK_FALSE(rival.add(0, second, 5'000));
        CHECK_FALSE(rival.add(furthest, second, 5'000));
        CHECK(rival.add(2 * furthest + sign * beyond, second, 5'000) == (beyond == 0));
    }
}

TEST_CASE("candidate_pulse_train: one that does not agree begins anew") {
    const Nanoseconds odd = GENERATE(as<Nanoseconds>{}, 2 * second + 200'001,  // off
                                     second + 300'000'000,  // less than half a period
                                     second,                // the same again
                                     6 * second);           // too long ago
    CAPTURE(odd);
    CandidatePulseTrain rival;
    CHECK_FALSE(rival.add(0, second, 5'000));
    CHECK_FALSE(rival.add(second, second, 5'000));
    CHECK_FALSE(rival.add(odd, second, 5'000));
    CHECK(rival.first() == odd);
    CHECK(rival.periods() == 0);
    CHECK_FALSE(rival.add(odd + second, second, 5'000));
    CHECK(rival.add(odd + 2 * second, second, 5'000));
    CHECK(rival.periods() == 2);
}
