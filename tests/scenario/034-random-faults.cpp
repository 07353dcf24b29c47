// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE(
    "034-random-faults: whatever cameras, strobes, code and host do at once, no record says what "
    "did not "
    "happen",
    "[native]") {
    const auto seed = GENERATE(range(1U, 41U));
    Scenario world(seed);
    std::mt19937_64 random(seed);
    const auto draw = [&random](std::uint64_t below) { return random() % below; };
    for (unsigned camera = 0; camera < 4; ++camera) {
        CameraSettings settings;
        settings.trigger_inverted = draw(2) == 0;
        settings.strobe_inverted = draw(2) == 0;
        settings.jitter = static_cast<Nanoseconds>(draw(20)) * us;
        settings.readout = static_cast<Nanoseconds>(draw(10)) * ms;
        const std::uint64_t salt = draw(1000);
        settings.fault = [salt](std::uint64_t pulse) {
            const std::uint64_t dice = (pulse * 2654435761U + salt * 7919U) >> 7U;
            return dice % 9 == 0 ? static_cast<Fault>(dice / 9 % 6) : Fault::none;
        };
        settings.exposure = [salt](std::uint64_t pulse, auto) {
            return static_cast<Nanoseconds>(1 + (pulse * 40503U + salt) % 60) * ms / 2;
        };
        world.add_camera(camera, settings,
                         static_cast<std::uint32_t>(1'000'000 + draw(60'000'000)));
    }
    world.configuration.illumination = {
        15, 0, 0, 100'000, 20'000'000, static_cast<std::uint32_t>(1 + draw(900'000))};
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448a, &World::motion),
        wire::ImuKind::adis16448a, 409.6, true);
    world.drops_allowed = world.busy_allowed = world.gaps_allowed = true;
    REQUIRE(world.begin(seed % 2 == 0 ? wire::start_pattern : 0));
    for (int i = 0; i < 40; ++i) {
        world.run(static_cast<Nanoseconds>(draw(500)) * ms);
        if (draw(5) == 0) world.stall_board(static_cast<Nanoseconds>(draw(60)) * ms);
        if (draw(5) == 0) world.stall_host(static_cast<Nanoseconds>(draw(900)) * ms);
        if (draw(5) == 0) {
            const auto cameras = static_cast<std::uint8_t>(draw(16));
            world.start(cameras, static_cast<std::uint8_t>(draw(3)));
        }
        if (draw(7) == 0) world.stop(static_cast<std::uint8_t>(draw(16)));
        if (draw(3) == 0)
            world.send(wire::ExpectedExposure{static_cast<std::uint8_t>(draw(5)),
                                              {},
                                              draw(300),
                                              static_cast<Nanoseconds>(draw(60)) * ms});
    }
    world.run(200 * ms);
    world.finish();
    CHECK(world.judge() == "");
}
