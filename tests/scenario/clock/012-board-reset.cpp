// SPDX-License-Identifier: BSD-3-Clause
// The board is reset: its clock begins anew.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "score.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE(
    "clock 012: a board that is reset is known again after one exchange, unannounced after three, "
    "with "
    "its skew") {
    const bool announced = GENERATE(true, false);
    Settings settings;
    settings.length = seconds(130);
    settings.board_begin = seconds(1000);
    settings.board_reset = TrueTime{seconds(100).ns};
    for (settings.seed = 1; settings.seed <= 10; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        const double skew = observer.at(*settings.board_reset - milliseconds(1)).skew_ppm();
        if (announced) {
            observer.at(*settings.board_reset).board_restarted();
            CHECK(observer.estimate(*settings.board_reset).state == clock::ClockState::reset);
        }
        TrueTime first = *settings.board_reset;
        int exchanges = announced ? 1 : 3;  // a single one may lie
        for (const Delivery& delivery : world.deliveries())
            if (delivery.at > first && exchanges-- > 0) first = delivery.at;
        CHECK(absolute(observer.error(first)) < milliseconds(1));
        CHECK(observer.at(first).skew_ppm() == Approx(skew).margin(0.5));
        CHECK(observer.at(first).restarts() == (announced ? 0 : 1));
        CHECK(absolute(observer.error({seconds(129).ns})) < microseconds(40));
    }
}
