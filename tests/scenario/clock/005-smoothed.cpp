// SPDX-License-Identifier: BSD-3-Clause
// A recording, smoothed: later messages improve the estimates of earlier instants.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/smoother.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 005: a recording is smoothed") {
    Settings settings;
    settings.imu_hz = 200;
    settings.length = seconds(300);
    Score smoothed;
    for (settings.seed = 1; settings.seed <= 6; ++settings.seed) {
        const World world(settings);
        const clock::Smoother smoother(messages_of(world));
        for (TrueTime t{seconds(1).ns}; t.ns < seconds(299).ns; t = t + milliseconds(100)) {
            const clock::HostEstimate estimate = smoother.translate(world.board(t));
            CHECK(estimate.state == clock::ClockState::locked);
            smoothed.add(estimate.time - world.host(t), estimate);
        }
    }
    CHECK(smoothed.p99_us() <= 6);
    CHECK(smoothed.nees() < 2);
}

TEST_CASE("clock 005: a silence is bridged from both sides") {
    Settings settings;
    settings.imu_hz = 200;
    settings.length = seconds(360);
    settings.silence = {{seconds(200).ns}, {seconds(260).ns}};
    Score smoothed;
    Score at_once;
    for (settings.seed = 1; settings.seed <= 8; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        observer.observe(settings.silence, seconds(1), at_once);
        const clock::Smoother smoother(messages_of(world));
        for (TrueTime t = settings.silence.begin; t < settings.silence.end; t = t + seconds(1)) {
            const clock::HostEstimate estimate = smoother.translate(world.board(t));
            smoothed.add(estimate.time - world.host(t), estimate);
        }
    }
    CHECK(smoothed.quantile_us(0.95) < at_once.quantile_us(0.95) / 1.5);
    CHECK(smoothed.nees() < 2);
}

TEST_CASE("clock 005: each life of a board is smoothed by itself") {
    Settings settings;
    settings.length = seconds(120);
    settings.board_begin = seconds(1000);
    settings.board_reset = TrueTime{seconds(60).ns};
    const World world(settings);
    const clock::Smoother smoother(messages_of(world));
    CHECK(smoother.segments() == 2);
    for (const TrueTime t :
         {TrueTime{seconds(30).ns}, TrueTime{seconds(59).ns}, TrueTime{seconds(62).ns}})
        CHECK(absolute(smoother.translate(world.board(t)).time - world.host(t)) < microseconds(60));
}

TEST_CASE("clock 005: nothing is known without a message") {
    CHECK(clock::Smoother({}).translate({5}).state == clock::ClockState::init);
}
