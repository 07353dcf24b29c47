// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

void run_triggers(unsigned triggers, std::uint32_t rate_uhz) {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](auto, auto) { return 2 * ms; };
    world.add_camera(0, settings, rate_uhz);
    REQUIRE(world.begin());
    world.set_link(second, 1U << 20U, 1U << 20U);
    const Nanoseconds duration = static_cast<Nanoseconds>(1e15 / rate_uhz * triggers) + second;
    for (Nanoseconds left = duration; left > 0; left -= 1000 * second) {
        world.run(std::min(left, 1000 * second));
        for (const wire::Exposure& record : world.inbox().exposures[0])
            if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
        if (left > 1000 * second) world.inbox().exposures.clear();
    }
    world.finish();
    const wire::Exposure& last = world.inbox().exposures[0].back();
    CHECK(last.trigger >= triggers);
    CHECK(last.tick - last.trigger < 10);
    CHECK(world.inbox().lost == 0);
}

constexpr unsigned million = 1'000'000;

}  // namespace

// Twenty minutes: the counters of a chip wrap after 34 and 68 s.
TEST_CASE("011-no-drift-chip: a hundred thousand triggers at 90 Hz") {
    run_triggers(100'000, 90'000'000);
}
TEST_CASE("011-no-drift-7: a million triggers at 7 Hz", "[native]") {
    run_triggers(million, 7'000'000);
}
TEST_CASE("011-no-drift-14: a million triggers at 14 Hz", "[native]") {
    run_triggers(million, 14'000'000);
}
TEST_CASE("011-no-drift-90: a million triggers at 90 Hz", "[native]") {
    run_triggers(million, 90'000'000);
}
TEST_CASE("011-no-drift-29.97: a million triggers at 29.97 Hz", "[native]") {
    run_triggers(million, 29'970'000);
}

TEST_CASE("011-microseconds: a chip's counter of them wraps after 71.6 minutes, nothing slips") {
    Scenario world;
    world.add_camera(0, {}, 1'000'000);
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9 + 12'000);
    REQUIRE(world.begin());
    world.run(4'500 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.inbox().exposures[0].size() >= 4'499);
    CHECK(world.inbox().events_of(wire::BoardEventKind::pps).size() >= 4'499);
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
}
