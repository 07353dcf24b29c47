// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("018-strobe-stuck: a line that stays active leaves no light on") {
    Scenario world;
    CameraSettings settings;
    settings.fault = [](std::uint64_t pulse) {
        return pulse >= 30 && pulse < 40 ? Fault::stuck : Fault::none;
    };
    world.add_camera(0, settings);
    world.configuration.illumination = {1, 0, 0, 100'000, 10'000'000, 200'000};
    REQUIRE(world.begin());
    world.run(10 * second);
    world.finish();
    CHECK(world.judge() == "");  // never longer than 10 ms, nor more than a fifth of the time
    CHECK_FALSE(world.inbox().events_of(wire::BoardEventKind::illumination_limited).empty());
    // Afterwards the light works again.
    const TruePulse& later = world.camera(0).pulses()[100];
    CHECK(std::any_of(world.lights().begin(), world.lights().end(), [&](const Interval& interval) {
        return interval.on <= later.start && interval.off >= later.end;
    }));
}

TEST_CASE("018-too-much-light: the part of the time is kept, whatever the cameras ask for") {
    const auto seed = GENERATE(range(1U, 9U));
    Scenario world(seed);
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.exposure = [=](std::uint64_t pulse, auto) {
            return static_cast<Nanoseconds>(1 + (pulse * 37 + seed * 11 + camera * 5) % 17) * ms;
        };
        settings.fault = [=](std::uint64_t pulse) {
            return (pulse * 40503U + seed + camera) % 11 == 0 ? Fault::stuck : Fault::none;
        };
        world.add_camera(camera, settings, 15'000'000 + camera * 3'700'000);
        world.configuration.cameras[camera].phase_ns = camera * 9'000'000;
    }
    world.configuration.illumination = {15, 0, 0, 100'000, 25'000'000, 50'000 * seed};
    REQUIRE(world.begin());
    world.run(30 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.lights().size() > 50);
}

TEST_CASE("018-camera-gone: without exposures there is the lead alone") {
    Scenario world;
    CameraSettings settings;
    settings.fault = [](auto) { return Fault::ignored; };
    world.add_camera(0, settings);
    world.configuration.illumination = {1, 0, 0, 100'000, 10'000'000, 500'000};
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    REQUIRE(world.lights().size() >= 99);
    for (const Interval& interval : world.lights()) CHECK(interval.off - interval.on <= 200 * us);
}

TEST_CASE("018-no-strobe: a camera without exposure line is lit as it is expected to expose") {
    Scenario world;
    CameraSettings settings;
    settings.strobe = false;
    world.add_camera(0, settings);
    world.configuration.illumination = {1,      wire::illumination_inverted, 0, 100'000, 10'000'000,
                                        500'000};
    world.configuration.illumination.flags = 0;
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
    for (const Interval& interval : world.lights())
        REQUIRE(std::abs(interval.off - interval.on - 3 * ms - 100 * us) <= world.rounding());
}
