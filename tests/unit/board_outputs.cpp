// SPDX-License-Identifier: BSD-3-Clause
// Where the board's inputs and outputs lead: routes, light, test pulses, the IMU's output.
#include "board.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <memory>

#include "adis_device.hpp"
#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::firmware;

TEST_CASE("board: a light that ends as soon as the port can is not late") {
    scenario::World world(1, firmware::chip_model(2 * us, 1));
    world.add_camera(0);
    world.configuration.illumination = {1, 0, {}, 0, 10'000'000, 1'000'000};
    REQUIRE(world.begin());
    world.run(second);
    REQUIRE(world.lights().size() >= 19);
    CHECK(world.inbox().events_of(wire::BoardEventKind::output_late).empty());
}

TEST_CASE("board: samples are served at the second port where the configuration says so") {
    for (const bool serves : {false, true}) {
        scenario::World world;
        world.add_imu(std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b,
                                                            &scenario::World::motion),
                      wire::ImuKind::adis16448b, 819.2, true);
        if (serves) world.configuration.ports.options = wire::port_imu_output;
        REQUIRE(world.begin());
        world.run(second);
        const std::uint16_t question[] = {0x5600, 0x0000};
        CHECK((world.native_board().read_imu_output(question)[1] != 0) == serves);
    }
}

TEST_CASE("board: light that went out late counts for as long as it was on") {
    const auto limited = [](Nanoseconds late) {
        Cameras bench(1);
        bench.configuration.illumination = {1, 0, 0, 0, 10'000'000, 90'000};  // 4.5 ms of 50 ms
        bench.configure();
        bench.send(wire::Start{1, 0, {}});
        bench.run(50 * ms);
        bench.port.late = late;
        for (int i = 0; i < 60; ++i) {
            const Nanoseconds trigger = bench.trigger();
            bench.edge(0, trigger);
            bench.poll(std::max(trigger, bench.port.time));
            bench.run(trigger + 3'400 * us);
            bench.edge(0, trigger + 3'400 * us, false);
            bench.poll(trigger + 3'400 * us);
            bench.run(trigger + 49 * ms + 900 * us);
        }
        return bench.events(wire::BoardEventKind::illumination_limited).size();
    };
    CHECK(limited(0) == 0);
    CHECK(limited(800 * us) > 10);
}

TEST_CASE("board: it listens to what the configuration uses") {
    using Flags = std::array<std::uint32_t, 4>;
    struct Case {
        Flags cameras;  ///< 0: not enabled
        std::uint8_t pulses, spi_options, uart_options;
        std::uint32_t listens;
    };
    const std::uint32_t on = wire::camera_enabled;
    const std::uint32_t blind = wire::camera_enabled | wire::camera_no_strobe;
    const Case cases[] = {{{0, 0, 0, 0}, 0, 0, 0, 0},
                          {{on, 0, on, 0}, 0, 0, 0, 0b101},
                          {{0, on, blind, on}, 0b1001, 0, 0, 0b10'0100'1010},
                          {{0, 0, 0, 0}, 0b0110, wire::imu_data_ready, 0, 0b1'1001'0000},
                          {{blind, 0, 0, on}, 0, 0, wire::imu_data_ready, 0b10'1000},
                          {{on, on, on, on},
                           0b1111,
                           wire::imu_data_ready | wire::imu_accel_ready,
                           wire::imu_data_ready,
                           0b111'1111'1111}};
    BoardBench bench;
    CHECK(bench.port.inputs == 0);
    bench.configuration.illumination.reserved = 0xFFFF;  // says nothing
    for (const Case& one : cases) {
        for (unsigned i = 0; i < 4; ++i) {
            bench.add_camera(i);
            bench.configuration.cameras[i].flags = one.cameras[i];
        }
        bench.configuration.ports.inputs = one.pulses;
        bench.configuration.imus[0] = {wire::ImuKind::bmi088, 0, one.spi_options, 0, 400'000};
        bench.configuration.imus[1] = {wire::ImuKind::vn100, 0, one.uart_options, 0, 200'000};
        bench.configure();
        CHECK(bench.port.inputs == one.listens);
    }
}

TEST_CASE("board: routes and levels at rest are those of the configuration, at once") {
    Cameras bench(4);
    bench.configuration.cameras[1].flags |= wire::camera_strobe_inverted;
    bench.configuration.cameras[2].flags |= wire::camera_trigger_inverted;
    bench.configuration.cameras[3].flags |= wire::camera_no_strobe;
    bench.configuration.illumination = {0b1010, wire::illumination_inverted, 0, 0, 3'000'000,
                                        1'000};
    bench.configure();
    const Routes& routes = bench.port.routes;
    CHECK(bench.port.forced);
    CHECK(routes.light_cameras == 0b0010);  // without an exposure line, the plan leads
    CHECK(routes.light_limit == 3 * ms);
    CHECK(routes.light_inverted);
    CHECK(routes.inverted_exposures == 0b0010);
    CHECK(routes.inverted_triggers == 0b0100);
    CHECK(routes.test_input == not_routed);
    for (const std::uint8_t master : routes.master) CHECK(master == not_routed);
    bench.run_for(2 * ms);
    REQUIRE_FALSE(bench.port.words.empty());
    CHECK(bench.port.words.back().second == 0b0100);
    bench.configuration.cameras[2].flags = wire::camera_enabled;
    bench.configuration.illumination = {};
    bench.configure();
    CHECK_FALSE(routes.light_inverted);
    CHECK(routes.light_cameras == 0);
    CHECK(routes.inverted_triggers == 0);
    bench.run_for(2 * ms);
    CHECK(bench.port.words.back().second == 0);
}

TEST_CASE("board: the test output shows the data-ready line of an IMU that has one") {
    BoardBench bench;
    bench.configuration.illumination.reserved = 0xFFFF;  // says nothing
    for (const bool ready : {false, true})
        for (const unsigned port : {0U, 1U}) {
            if (!ready && port == 1) continue;  // nothing shows its ticks
            add_imus(bench, ready ? wire::imu_data_ready : 0);
            bench.configuration.ports.test = static_cast<std::uint8_t>(wire::test_imu0 + port);
            bench.configure();
            CHECK(bench.port.routes.test_input == (ready ? input_imu_ready + port : not_routed));
        }
    for (const std::uint8_t test : {wire::test_none, wire::test_camera0, wire::test_rate}) {
        add_imus(bench, wire::imu_data_ready);
        bench.add_camera(0);
        bench.configuration.ports.test = test;
        bench.configuration.ports.test_rate_millihertz = 1'000;
        bench.configure();
        CHECK(bench.port.routes.test_input == not_routed);
    }
}

TEST_CASE("board: the test output shows the middles of a camera's exposures") {
    for (const std::uint8_t camera : {0, 2}) {
        Cameras bench(3);
        bench.configuration.cameras[camera].latency_ns = 30'000;
        bench.configuration.ports.test = static_cast<std::uint8_t>(wire::test_camera0 + camera);
        bench.configure();
        bench.send(wire::Start{7, 0, {}});
        bench.run(120 * ms);
        CHECK(bench.pulses(output_test) == std::vector<Nanoseconds>{50 * ms, 100 * ms});
        CHECK(bench.pulses(camera) == std::vector<Nanoseconds>{47'970 * us, 97'970 * us});
    }
}

TEST_CASE("board: pulses at a rate of their own leave where they are configured to") {
    const std::pair<std::uint8_t, unsigned> places[] = {{wire::test_at_test, output_test},
                                                        {wire::test_at_sync, output_sync},
                                                        {wire::test_at_camera0, 0},
                                                        {wire::test_at_camera0 + 2, 2}};
    for (const auto& [place, output] : places) {
        Cameras bench(0);
        bench.configuration.ports.test = wire::test_rate;
        bench.configuration.ports.test_rate_millihertz = 100'000;
        bench.configuration.ports.test_output = place;
        bench.configure();
        bench.run(36 * ms);
        CHECK(bench.pulses(output) == std::vector<Nanoseconds>{10 * ms, 20 * ms, 30 * ms});
        CHECK(bench.pulsed() == 1U << output);
    }
}

TEST_CASE("board: the test output shows the grid on which an IMU is read, if one is") {
    Cameras bench(0);
    bench.configuration.ports.test = wire::test_imu0;
    bench.configuration.imus[1] = {wire::ImuKind::vn100, 0, 0, 0, 200'000};  // it is not read
    bench.configure();
    bench.run(100 * ms);
    CHECK(bench.pulsed() == 0);
    add_imus(bench, 0);
    bench.configure();
    bench.run(110 * ms);
    const auto pulses = bench.pulses(output_test);
    REQUIRE(pulses.size() >= 3);
    CHECK(pulses[2] - pulses[1] == 2'500 * us);
    bench.configuration.imus[0].options = wire::imu_data_ready;  // then the line itself is shown
    bench.configure();
    bench.pulsed();
    bench.run(150 * ms);
    CHECK(bench.pulsed() == 0);
}

TEST_CASE("board: triggers of cameras that are lit are decided sooner by the light's lead") {
    for (unsigned camera = 0; camera < 4; ++camera)
        for (const unsigned lit : {0U, 1U << camera, 15U & ~(1U << camera)}) {
            Cameras bench(4);
            bench.configuration.illumination = {
                static_cast<std::uint8_t>(lit), 0, 0, 400'000, 20'000'000, 500'000};
            bench.configure();
            bench.send(wire::Start{static_cast<std::uint8_t>(1U << camera), 0, {}});
            bench.run(40 * ms);
            CHECK(bench.board.next_wake() == 47 * ms - (lit == 1U << camera ? 400 * us : 0));
        }
}

TEST_CASE("board: light follows a camera without an exposure line by the plan, slaves too") {
    for (const std::uint8_t master : {0, 1}) {
        const auto slave = static_cast<std::uint8_t>(1 - master);
        const auto leads = [&](unsigned lit, bool with_slave) {
            BoardBench bench;
            bench.add_camera(master);
            bench.add_slave(slave, master);
            bench.configuration.illumination = {
                static_cast<std::uint8_t>(1U << lit), 0, 0, 200'000, 20'000'000, 500'000};
            bench.configure();
            bench.send(
                wire::Start{static_cast<std::uint8_t>(with_slave ? 3 : 1U << master), 0, {}});
            bench.run(60 * ms);
            return bench.pulses(output_light_lead).size();
        };
        CHECK(leads(master, false) == 1);
        CHECK(leads(slave, false) == 0);
        CHECK(leads(slave, true) == 1);
    }
}

TEST_CASE("board: light that no exposure follows goes out, as soon as none can come") {
    Cameras bench(1);
    bench.configuration.illumination = {1, 0, 0, 0, 40'000'000, 1'000'000};
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(90 * ms);
    bool open = false;
    Nanoseconds closed = 0;
    for (const auto& [at, levels] : bench.port.words) {
        const bool now = (levels >> output_light_gate & 1U) != 0;
        if (open && !now) closed = at;
        open = now;
    }
    CHECK(closed > 48 * ms);
    CHECK(closed < 51 * ms);
}
