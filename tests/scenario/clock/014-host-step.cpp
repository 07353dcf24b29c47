// SPDX-License-Identifier: BSD-3-Clause
// The clock of the host is stepped, which the one that is used never should be.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 014: a step is flagged at once and over after three exchanges") {
    const TrueTime stepped{seconds(100).ns};
    const Duration step = GENERATE(seconds(1), -seconds(1), milliseconds(20), -milliseconds(5));
    Settings settings;
    settings.length = seconds(160);
    settings.imu_hz = GENERATE(0.0, 200.0);
    settings.host_changes = {{stepped, step}};
    for (settings.seed = 1; settings.seed <= 6; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        int exchanges = 0;  // that began after the step
        for (const Delivery& delivery : world.deliveries()) {
            const auto* exchange = std::get_if<clock::Exchange>(&delivery.message);
            const clock::HostEstimate estimate = observer.estimate(delivery.at);
            if (exchange == nullptr || delivery.at < stepped) continue;
            const Duration took = exchange->arrived - exchange->sent;
            const bool across = took.ns < 0 || delivery.at - took < stepped;
            // One that took nearly as long as the step hides it.
            if (across || took >= absolute(step) - milliseconds(1)) continue;
            const Duration error = absolute(estimate.time - world.host(delivery.at));
            if (++exchanges < 3) CHECK(estimate.state == clock::ClockState::step);
            CHECK(error <= estimate.bound);
            if (exchanges > 4) CHECK(error < milliseconds(2));
        }
        CHECK(exchanges > 4);
        CHECK(observer.at({seconds(160).ns}).restarts() == 1);
    }
}
