// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

void make_slave(Scenario& world, unsigned output, bool strobe, bool inverted) {
    CameraSettings settings;
    settings.trigger_width = true;
    settings.strobe = strobe;
    settings.trigger_inverted = inverted;
    settings.latency = 5 * us;
    world.add_camera(output, settings);
    world.configuration.cameras[output].flags |= wire::camera_slave;
    world.configuration.cameras[output].master = 0;
}

}  // namespace

TEST_CASE("013-master-slave: slaves expose as long as their master, whatever its exposure does") {
    Scenario world;
    CameraSettings master;
    master.strobe_inverted = GENERATE(false, true);
    master.exposure = [](std::uint64_t pulse, auto) {
        return (1 + static_cast<Nanoseconds>(pulse % 9)) * ms;
    };
    master.fault = [](std::uint64_t pulse) {
        return pulse % 13 == 0 ? Fault::ignored : Fault::none;
    };
    world.add_camera(0, master);
    make_slave(world, 1, true, false);
    make_slave(world, 2, false, true);
    REQUIRE(world.begin());
    world.run(60 * second);
    world.finish();
    CHECK(world.judge() == "");
    const auto& masters = world.camera(0).pulses();
    const auto exposures = static_cast<std::size_t>(std::count_if(
        masters.begin(), masters.end(), [](const TruePulse& pulse) { return pulse.taken; }));
    for (const unsigned slave : {1U, 2U}) {
        // A slave has a pulse, and a record, for each exposure of the master, not for each of its
        // triggers.
        REQUIRE(world.inbox().exposures[slave].size() == exposures);
        for (std::size_t i = 0; i < exposures; ++i) {
            const wire::Exposure& record = world.inbox().exposures[slave][i];
            const auto& of_master = world.inbox().exposures[0];
            const auto found =
                std::find_if(of_master.begin(), of_master.end(),
                             [&](const wire::Exposure& m) { return m.tick == record.tick; });
            REQUIRE(found != of_master.end());
            const Nanoseconds longer =
                record.end_ns - record.start_ns - (found->end_ns - found->start_ns);
            REQUIRE(std::abs(longer) <= world.rounding());
            const Nanoseconds later =
                slave == 1 ? 5 * us + firmware::NativeBoard::routing_latency : 0;
            REQUIRE(std::abs(record.start_ns - found->start_ns - later) <= world.rounding());
        }
    }
}

TEST_CASE("013-slave-pattern: a slave that asks for the start pattern gets it by its master") {
    Scenario world;
    world.add_camera(0);
    make_slave(world, 1, true, false);
    world.gaps_allowed = true;
    world.connect();
    REQUIRE(world.configure());
    world.start(1);
    world.run(second);
    world.start(2, wire::start_pattern);
    world.run(3 * second);
    world.finish();
    CHECK(world.judge() == "");
    CHECK(count(world.inbox().exposures[0], wire::exposure_pattern) == 11);
    const auto& slave = world.inbox().exposures[1];
    const std::size_t first =
        slave[0].tick + 1 == slave[1].tick && slave[1].tick + 1 == slave[2].tick ? 1 : 0;
    std::vector<std::uint64_t> gaps;
    for (std::size_t i = first; i < first + 10; ++i)
        gaps.push_back(slave[i + 1].tick - slave[i].tick);
    CHECK(gaps == std::vector<std::uint64_t>{1, 2, 1, 3, 2, 2, 3, 3, 1, 1});
}

TEST_CASE("013-slave-stops: a slave that is stopped gets no more pulses") {
    Scenario world;
    world.add_camera(0);
    make_slave(world, 1, true, false);
    REQUIRE(world.begin());
    world.run(second);
    world.stop(2);
    world.run(100 * ms);
    const std::size_t pulses = world.camera(1).pulses().size();
    world.run(second);
    CHECK(world.camera(1).pulses().size() == pulses);
    world.start(2);
    world.run(second);
    CHECK(world.camera(1).pulses().size() > pulses + 15);
    world.finish();
    CHECK(world.judge() == "");
}
