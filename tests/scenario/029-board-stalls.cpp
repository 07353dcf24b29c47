// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "029-board-stalls: code that stands still past its triggers skips them, reports it, and goes "
    "on at "
    "once",
    "[native]") {
    const Nanoseconds stall = GENERATE(500 * us, 3 * ms, 30 * ms, 130 * ms);
    Scenario world;
    for (unsigned camera = 0; camera < 4; ++camera) world.add_camera(camera, {}, 50'000'000);
    world.configuration.ports.sync_rate_uhz = 10'000'000;
    world.configuration.ports.pulse_ns = 1'000'000;
    REQUIRE(world.begin());
    for (int i = 0; i < 40; ++i) {
        world.run(199 * ms);
        world.stall_board(stall + i * 97 * us);
        world.run(stall + 5 * ms);
    }
    world.finish();
    CHECK(world.judge() == "");  // each record is true, each grid point accounted for
    std::size_t skipped = 0;
    for (const wire::Event& event :
         world.inbox().events_of(wire::BoardEventKind::trigger_skipped)) {
        CHECK(event.detail == static_cast<std::uint16_t>(wire::SkipReason::late));
        ++skipped;
    }
    for (const wire::Event& event : world.inbox().events_of(wire::BoardEventKind::triggers_skipped))
        skipped += event.detail;
    if (stall > 20 * ms) CHECK(skipped > 100);
    world.run(second);
    CHECK(world.inbox().healths.back().skipped_triggers == skipped);
    const auto& healths = world.inbox().healths;
    const auto longest = std::max_element(
        healths.begin(), healths.end(),
        [](const auto& a, const auto& b) { return a.loop_max_ns < b.loop_max_ns; });
    CHECK(longest->loop_max_ns >= stall / 2);
    // A sync pulse is on time, or left out.
    for (const Nanoseconds at : world.rises(firmware::pin_sync)) {
        const Nanoseconds phase = (at - world.grid_time(0, 0) + 50 * ms) % (100 * ms);
        REQUIRE(std::abs(phase - 50 * ms) <= world.rounding());
    }
}

TEST_CASE("029-watchdog: code that stands still for good is reset, and the host learns why",
          "[native]") {
    Scenario world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(2 * second);
    CHECK_FALSE(world.board().watchdog_bit());
    world.stall_board(1100 * ms);
    REQUIRE(world.board().watchdog_bit());
    world.run(1200 * ms);
    const std::size_t pulses = world.camera(0).pulses().size();
    world.reboot(wire::ResetCause::watchdog);
    world.run(second);
    CHECK(world.camera(0).pulses().size() == pulses);  // silent until hello
    REQUIRE(world.begin());
    CHECK(world.inbox().hellos.back().reset_cause == wire::ResetCause::watchdog);
    world.run(2 * second);
    CHECK(world.camera(0).pulses().size() > pulses + 35);
    CHECK(world.inbox().healths.back().reset_cause == wire::ResetCause::watchdog);
}

TEST_CASE("029-idle: nothing to do for long is no reason for the watchdog") {
    Scenario world;
    world.connect();
    world.run(100 * second);
    CHECK_FALSE(world.board().watchdog_bit());
}
