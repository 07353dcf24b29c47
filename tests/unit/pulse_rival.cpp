// SPDX-License-Identifier: BSD-3-Clause
#include "pulse_rival.hpp"

#include <catch2/catch.hpp>

using namespace versavis::firmware;

namespace {
constexpr Nanoseconds second = 1'000'000'000;
}

TEST_CASE("pulse_rival: three pulses whole periods apart agree, over short gaps") {
    PulseRival rival;
    CHECK_FALSE(rival.add(100, second, 5'000));
    CHECK_FALSE(rival.add(100 + second + 200'000, second, 5'000));
    CHECK(rival.add(100 + 5 * second, second, 5'000));
    CHECK(rival.first() == 100);
    CHECK(rival.newest() == 100 + 5 * second);
    CHECK(rival.periods() == 5);
    rival.clear();
    CHECK_FALSE(rival.add(100 + 6 * second, second, 5'000));
}

TEST_CASE("pulse_rival: one that does not agree begins anew") {
    for (const Nanoseconds off : {200'001, -200'001}) {
        PulseRival rival;
        CHECK_FALSE(rival.add(0, second, 5'000));
        CHECK_FALSE(rival.add(second, second, 5'000));
        CHECK_FALSE(rival.add(2 * second + off, second, 5'000));
        CHECK(rival.first() == 2 * second + off);
        CHECK_FALSE(rival.add(3 * second + off, second, 5'000));
        CHECK(rival.add(4 * second + off, second, 5'000));
    }
    PulseRival rival;
    rival.add(0, second, 5'000);
    rival.add(second, second, 5'000);
    CHECK_FALSE(rival.add(second + 300'000'000, second, 5'000));  // less than half a period
    rival.clear();
    rival.add(0, second, 5'000);
    rival.add(second, second, 5'000);
    CHECK_FALSE(rival.add(6 * second, second, 5'000));  // too long ago
}
