// SPDX-License-Identifier: BSD-3-Clause
#include "health/health_log.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

const HostTime start{1'000'000'000};
const Summary ok{Health::ok, false, "", "ok"};
const Summary slow{Health::degraded, false, "cam0: packet_loss", "degraded: cam0: 3 of 20"};
const Summary dead{Health::degraded, true, "cam0: camera_absent", "degraded: cam0: gone"};

}  // namespace

TEST_CASE("health_log: the level is as severe as the state") {
    CHECK(severity(Summary{}) == LogLevel::info);
    CHECK(severity(ok) == LogLevel::info);
    CHECK(severity(slow) == LogLevel::warning);
    CHECK(severity(dead) == LogLevel::error);
}

TEST_CASE("health_log: a change of health is logged at once, and once") {
    HealthLog log;
    CHECK(log.see(ok, start) == LogLevel::info);
    CHECK(log.see(slow, start + milliseconds(50)) == LogLevel::warning);
    Summary reworded = slow;
    reworded.text = "degraded: cam0: 4 of 20";
    CHECK_FALSE(log.see(reworded, start + seconds(10)));
    CHECK(log.see(ok, start + seconds(11)) == LogLevel::info);
}

TEST_CASE("health_log: another cause is logged when it lasts, and not when two take turns") {
    HealthLog log;
    CHECK(log.see(slow, start) == LogLevel::warning);
    for (int i = 0; i < 10; ++i) CHECK_FALSE(log.see(i % 2 == 0 ? dead : slow, start + seconds(i)));
    CHECK_FALSE(log.see(dead, start + seconds(10)));
    CHECK_FALSE(log.see(dead, start + seconds(10) + HealthLog::patience - milliseconds(1)));
    CHECK(log.see(dead, start + seconds(10) + HealthLog::patience) == LogLevel::error);
    CHECK_FALSE(log.see(dead, start + seconds(60)));
}
