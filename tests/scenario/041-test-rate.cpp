// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("041-test-rate: pulses at a rate of their own, at any output that nothing else uses") {
    struct Case {
        std::uint8_t output;
        unsigned pin;
    };
    const Case where =
        GENERATE(Case{wire::test_at_test, firmware::pin_test}, Case{wire::test_at_camera0 + 3, 3},
                 Case{wire::test_at_sync, firmware::pin_sync});
    const std::uint32_t rate_hz = GENERATE(970U, 1'000U, 10'000U);
    Scenario world;
    for (unsigned camera = 0; camera < 3; ++camera) world.add_camera(camera, {}, 50'000'000);
    world.configuration.ports.test = wire::test_rate;
    world.configuration.ports.test_rate_millihertz = rate_hz * 1'000;
    world.configuration.ports.test_output = where.output;
    world.configuration.ports.pulse_ns = 20'000;
    REQUIRE(world.begin());
    world.run(2 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& rises = world.rises(where.pin);
    REQUIRE(rises.size() > 2 * rate_hz);
    for (std::size_t i = 1; i < rises.size(); ++i) {
        const Nanoseconds since = rises[i] - rises[0];
        const auto expected = static_cast<Nanoseconds>(i) * second / rate_hz;
        REQUIRE(std::abs(since - expected) <= 1 + 2 * world.rounding());
    }
    CHECK(world.inbox().events_of(wire::BoardEventKind::output_late).empty());
}

TEST_CASE("041-test-rate-refused: an output in use, a rate or a width that does not fit") {
    const auto refused = [](auto change, wire::ConfigurationField field) {
        Scenario world;
        world.add_camera(0);
        world.configuration.ports.test = wire::test_rate;
        world.configuration.ports.test_rate_millihertz = 1'000'000;
        world.configuration.ports.pulse_ns = 20'000;
        change(world.configuration.ports);
        world.connect();
        CHECK_FALSE(world.configure());
        REQUIRE(world.inbox().refusals.size() == 1);
        CHECK(world.inbox().refusals[0].field == field);
    };
    using Ports = wire::PortConfiguration&;
    using Field = wire::ConfigurationField;
    refused([](Ports ports) { ports.test_output = wire::test_at_camera0; }, Field::test_output);
    refused(
        [](Ports ports) {
            ports.test_output = wire::test_at_sync;
            ports.sync_rate_uhz = 1'000'000;
        },
        Field::test_output);
    refused([](Ports ports) { ports.test_output = 6; }, Field::test_output);
    refused([](Ports ports) { ports.test_rate_millihertz = 99; }, Field::test_rate);
    refused(
        [](Ports ports) {
            ports.test_rate_millihertz = 10'000'001;
            ports.pulse_ns = 1'000;
        },
        Field::test_rate);
    refused([](Ports ports) { ports.pulse_ns = 500'001; }, Field::pulse);
    refused([](Ports ports) { ports.test = 8; }, Field::test);
}
