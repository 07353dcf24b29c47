// SPDX-License-Identifier: BSD-3-Clause
#include "skewed_clock.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using rig::SkewedClock;

TEST_CASE("skewed_clock: there and back is the same instant within a nanosecond, for days") {
    const SkewedClock clock(HostTime{5'000'000'000}, {7'000'000'000, 80.0, 0.01});
    for (std::int64_t t = 5'000'000'000; t < 200'000'000'000'000; t += 777'777'777'777) {
        const HostTime host{t};
        REQUIRE(absolute(clock.host(clock.device_ns(host)) - host).ns <= 1);
    }
    CHECK(clock.device_ns(HostTime{5'000'000'000}) == 7'000'000'000);
    CHECK(clock.device_ns(HostTime{6'000'000'000}) == Approx(8'000'080'005).epsilon(1e-12));
}
