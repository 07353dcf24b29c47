// SPDX-License-Identifier: BSD-3-Clause
// Exchanges over USB to a host that wakes up late: only messages to it wait for that, and their
// delays thin out towards the shortest one, where those to the board break off.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 021: late wake-ups of the host do not pass for time of the board") {
    Settings settings;
    settings.link = [](Random& random) {
        return usb_full_speed(
            {.transfer = microseconds(50), .wake_up = microseconds(40), .wakes_up_to_send = false},
            random);
    };
    Score result;
    double sum_us = 0;
    int count = 0;
    for (settings.seed = 1; settings.seed <= 12; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        for (TrueTime t{seconds(300).ns}; t.ns < settings.length.ns; t = t + milliseconds(100)) {
            const clock::HostEstimate estimate = observer.estimate(t);
            const Duration error = estimate.time - world.host(t);
            result.add(error, estimate);
            sum_us += static_cast<double>(error.ns) * 1e-3;
            ++count;
        }
    }
    CHECK(std::abs(sum_us / count) < 4);
    CHECK(result.p99_us() <= 12);
    check_honest(result);
}
