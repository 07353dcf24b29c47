// SPDX-License-Identifier: BSD-3-Clause
// What happens in between: commands in the middle of exposures, pulses that would merge, edges
// that are lost.
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

void add_slave(Scenario& world, unsigned output) {
    CameraSettings settings;
    settings.trigger_width = true;
    settings.latency = 5 * us;
    world.add_camera(output, settings);
    world.configuration.cameras[output].flags |= wire::camera_slave;
    world.configuration.cameras[output].master = 0;
}

void run_into_exposure(Scenario& world) {
    const auto exposing = [&] {
        const auto& pulses = world.camera(0).pulses();
        return !pulses.empty() && world.now() > pulses.back().start &&
               world.now() < pulses.back().end;
    };
    while (exposing()) world.run(ms);
    while (!exposing()) world.run(ms);
}

CameraSettings exposing_for(Nanoseconds exposure) {
    CameraSettings settings;
    settings.exposure = [exposure](auto, auto) { return exposure; };
    return settings;
}

}  // namespace

TEST_CASE("035-refused-while-one-waits: a refused configuration never comes into force") {
    Scenario world;
    world.add_camera(0, exposing_for(100 * ms), 5'000'000);
    world.configuration.cameras[0].max_exposure_ns = 190 * ms;
    REQUIRE(world.begin());
    world.run(second);
    run_into_exposure(world);
    world.stop();
    world.configuration.id = 77;
    world.send(world.configuration);  // waits for the exposure
    wire::Configuration wrong = world.configuration;
    wrong.id = 78;
    wrong.cameras[0].rate_uhz = 0;
    world.send(wrong);
    world.run(300 * ms);
    REQUIRE(world.inbox().answers.size() == 3);
    CHECK(world.inbox().answers[1].id == 78);
    CHECK(world.inbox().answers[1].status == wire::ConfigurationStatus::refused);
    CHECK(world.inbox().answers[2].id == 77);
    CHECK(world.inbox().answers[2].status == wire::ConfigurationStatus::taken);
    CHECK(world.inbox().refusals[0].id == 78);
}

TEST_CASE("035-far-test-pulse: a configuration does not wait for pulses that are far ahead") {
    Scenario world;
    world.add_camera(0, exposing_for(600 * ms), 1'000'000);
    world.configuration.cameras[0].exposure_ns = 600 * ms;
    world.configuration.cameras[0].max_exposure_ns = 900 * ms;
    world.configuration.ports.test = wire::test_camera0;
    world.configuration.ports.pulse_ns = 100'000;
    REQUIRE(world.begin());
    run_into_exposure(world);
    world.stop();
    world.configuration.id = 9;
    world.send(world.configuration);
    world.run(250 * ms);
    CHECK(world.inbox().answers.back().id == 9);
}

TEST_CASE("035-pulses-that-would-meet: two triggers never become one pulse") {
    Scenario world;
    CameraSettings settings;
    settings.exposure = [](std::uint64_t pulse, auto) { return pulse < 50 ? 100 * us : 6 * ms; };
    world.add_camera(0, settings, 100'000'000);
    world.configuration.cameras[0].pulse_ns = 4'000'000;
    world.configuration.cameras[0].exposure_ns = 100'000;
    REQUIRE(world.begin());
    world.send(wire::ExpectedExposure{0, {}, 50, 16 * ms});
    world.run(2 * second);
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE(
    "035-stall-at-a-trigger: words that could not be handed over in time leave as whole pulses",
    "[native]") {
    Scenario world;
    world.add_camera(0, {}, 100'000'000);
    world.configuration.cameras[0].pulse_ns = 2'000'000;
    REQUIRE(world.begin());
    for (int i = 0; i < 200; ++i) {
        world.run(50 * ms + i * 53 * us);
        world.stall_board((i % 12) * ms + i * 7 * us);
    }
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE(
    "035-slave-in-mid-exposure: a slave is started and stopped between exposures, with whole "
    "pulses that "
    "count") {
    Scenario world;
    world.add_camera(0, exposing_for(20 * ms));
    add_slave(world, 1);
    REQUIRE(world.begin());
    for (int i = 0; i < 10; ++i) {
        run_into_exposure(world);
        world.stop(2);
        world.run(200 * ms);
        run_into_exposure(world);
        world.start(2);
        world.run(200 * ms);
    }
    world.finish();
    CHECK(world.judge() == "");
    for (const TruePulse& pulse : world.camera(1).pulses())
        CHECK(pulse.end - pulse.start == 20 * ms);
}

TEST_CASE(
    "035-edges-lost: what was lost makes no record of two exposures, and a slave says that it may "
    "miscount",
    "[native]") {
    Scenario world;
    world.add_camera(0, exposing_for(300 * us), 1'000'000'000);
    add_slave(world, 1);
    world.configuration.ports.inputs = 1U << wire::pulse_aux0;
    REQUIRE(world.begin());
    world.run(500 * ms);
    const std::uint8_t aux = firmware::input_pulse + unsigned{wire::pulse_aux0};
    for (int round = 0; round < 5; ++round) {
        world.add_noise(aux, 4 * us, world.now() + 100 * us, world.now() + 1300 * us);
        world.stall_board(2600 * us);
        world.run(50 * ms);
    }
    world.finish();
    CHECK(world.inbox().healths.back().lost_edges > 0);
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if ((record.flags & wire::exposure_measured) != 0)
            REQUIRE(record.end_ns - record.start_ns == 300 * us);
    CHECK((world.inbox().exposures[1].back().flags & wire::exposure_uncounted) != 0);
}

TEST_CASE("035-late-start: a start that comes after the next trigger is still its own trigger's") {
    Scenario world;
    CameraSettings settings = exposing_for(300 * us);
    settings.latency = 9'500 * us;
    settings.fault = [](std::uint64_t pulse) {
        return pulse % 7 == 0 ? Fault::late_start : Fault::none;
    };
    world.add_camera(0, settings, 100'000'000);
    world.busy_allowed = true;
    REQUIRE(world.begin());
    world.run(5 * second);
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE("035-sync-and-start: a start that waits for sync disturbs nobody, and noise is no sync") {
    Scenario world;
    world.add_camera(0);
    world.configuration.ports.inputs = 1U << wire::pulse_sync;
    world.connect();
    REQUIRE(world.configure());
    const auto pulse = [&](Nanoseconds at) {
        world.board().schedule_edge({at, firmware::input_pulse + unsigned{wire::pulse_sync}, true});
        world.board().schedule_edge(
            {at + ms, firmware::input_pulse + unsigned{wire::pulse_sync}, false});
    };
    world.start(1, wire::start_on_sync);
    for (const Nanoseconds at : {700 * ms, 1000 * ms, 1400 * ms})
        pulse(at);  // noise: none a period apart
    world.run(1900 * ms);
    CHECK(world.camera(0).pulses().empty());
    world.start(1);  // it must not wait any longer
    world.run(second);
    const std::size_t before = world.camera(0).pulses().size();
    CHECK(before > 15);
    pulse(4000 * ms);
    pulse(5000 * ms);
    world.run(5 * second);
    CHECK(world.camera(0).pulses().size() > before + 95);
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE(
    "035-sync-and-start: how long cameras ran before does not matter to one that waits for sync") {
    Scenario world;
    world.add_camera(0);
    world.configuration.ports.inputs = 1U << wire::pulse_sync;
    REQUIRE(world.begin());
    world.run(20 * second);
    world.stop();
    world.run(second);
    world.start(1, wire::start_on_sync);
    const std::size_t before = world.camera(0).pulses().size();
    for (const Nanoseconds seconds : {22, 23, 24}) {
        const Nanoseconds at = seconds * second;
        world.board().schedule_edge({at, firmware::input_pulse + unsigned{wire::pulse_sync}, true});
        world.board().schedule_edge(
            {at + ms, firmware::input_pulse + unsigned{wire::pulse_sync}, false});
    }
    world.run(4 * second);
    CHECK(world.camera(0).pulses().size() > before + 30);
}

TEST_CASE("035-light-and-configurations: another configuration is no reason for more light") {
    Scenario world;
    world.add_camera(0, exposing_for(10 * ms));
    world.configuration.illumination = {1, 0, 0, 100'000, 10'500'000, 20'000};
    world.gaps_allowed = true;
    world.connect();
    for (int i = 0; i < 50; ++i) {
        REQUIRE(world.configure());
        world.start();
        world.run(130 * ms);
        world.stop();
    }
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE("035-light-without-strobe: at its limit there is a pause, and an event") {
    Scenario world;
    CameraSettings settings = exposing_for(30 * ms);
    settings.strobe = false;
    world.add_camera(0, settings, 10'000'000);
    world.configuration.cameras[0].exposure_ns = 30 * ms;
    world.configuration.illumination = {1, 0, 0, 100'000, 10'000'000, 500'000};
    REQUIRE(world.begin());
    world.run(2 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK_FALSE(world.inbox().events_of(wire::BoardEventKind::illumination_limited).empty());
    for (std::size_t i = 1; i < world.lights().size(); ++i)
        CHECK(world.lights()[i].on - world.lights()[i - 1].off >= ms);
}

TEST_CASE("035-slave-lit: light for a slave alone comes with its master's exposures") {
    Scenario world;
    world.add_camera(0);
    add_slave(world, 1);
    world.configuration.illumination = {2, 0, 0, 0, 10'000'000, 500'000};
    REQUIRE(world.begin());
    world.run(2 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(world.lights().size() >= 39);
}
