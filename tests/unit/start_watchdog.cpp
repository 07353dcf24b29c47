// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/start_watchdog.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("start_watchdog: the board is asked again after two seconds and five periods") {
    CameraConfiguration configuration;
    configuration.rate_hz = 10;
    StartWatchdog watch(configuration);
    const HostTime begin{100'000'000'000};
    watch.asked(begin);
    CHECK_FALSE(watch.overdue(begin + milliseconds(2500)));
    CHECK(watch.overdue(begin + milliseconds(2501)));
    watch.recorded(1, begin + milliseconds(2400));
    CHECK_FALSE(watch.overdue(begin + milliseconds(4900)));
    CHECK(watch.overdue(begin + milliseconds(4901)));
}

TEST_CASE("start_watchdog: triggers count as unanswered until a frame comes") {
    StartWatchdog watch(CameraConfiguration{});
    watch.recorded(4, {});
    watch.recorded(5, {});
    CHECK(watch.unanswered() == 2);
    CHECK(watch.newest() == 5);
    watch.answered();
    CHECK(watch.unanswered() == 0);
    CHECK(watch.newest() == 5);
}
