// SPDX-License-Identifier: BSD-3-Clause
// How cameras and slaves are started and stopped, and the grid that they are on.
#include "board.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>

#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::firmware;

TEST_CASE(
    "board: the host places the grid at once while no camera runs, and slews it when one does") {
    scenario::World world;
    world.add_camera(0);
    world.gaps_allowed = true;
    world.connect();
    CHECK((world.inbox().hellos[0].capabilities & wire::capability_host_grid) != 0);
    REQUIRE(world.configure());
    const auto off = [](const wire::Exposure& record, Nanoseconds second_at) {
        const Nanoseconds middle = record.start_ns + (record.end_ns - record.start_ns) / 2;
        const Nanoseconds past = (middle - second_at + 100 * second) % (50 * ms);  // 20 Hz
        return past > 25 * ms ? past - 50 * ms : past;
    };
    const Nanoseconds wanted = world.now() + 1'213 * ms;
    world.send(wire::AlignGrid{wanted, 0, 1000});
    world.start();
    world.run(3 * second);
    auto& records = world.inbox().exposures[0];
    REQUIRE(records.size() > 40);
    for (std::size_t i = 1; i < records.size(); ++i) REQUIRE(off(records[i], wanted) == 0);
    // Moved by 1 ms at 1000 ppm: a second later it is there, and no interval was wrong by more than
    // the slew.
    const std::size_t slewed_from = records.size();
    world.send(wire::AlignGrid{wanted + 7 * second + ms, 0, 1'000'000});
    world.run(3 * second);
    for (std::size_t i = slewed_from; i < records.size(); ++i)
        REQUIRE(std::abs(records[i].start_ns - records[i - 1].start_ns - 50 * ms) <= 50 * us + 2);
    CHECK(off(records.back(), wanted + ms) == 0);
    // A new configuration begins the grid anew.
    world.stop();
    REQUIRE(world.configure());
    world.start();
    world.run(second);
    CHECK(world.grid_error(records.back()) == 0);
    CHECK(world.inbox().healths.back().ignored == 0);
    world.finish();
    CHECK(world.judge() == "");
}

TEST_CASE("board: an alignment out of range is ignored, counted and reported") {
    scenario::World world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.run(second);
    const Nanoseconds now = world.now();
    const wire::AlignGrid junk[] = {{now, 500'001, 1000},       {now, -500'001, 1000},
                                    {now, INT32_MIN, 1000},     {now, 0, 0},
                                    {now, 0, 1'000'001},        {now + 101 * second, 0, 1000},
                                    {now - 101 * second, 0, 1}, {INT64_MIN, 0, 1000},
                                    {INT64_MAX, 0, 1000}};
    for (const wire::AlignGrid& message : junk) world.send(message);
    world.run(2 * second);
    for (const wire::Exposure& record : world.inbox().exposures[0])
        if (record.trigger > 1) REQUIRE(world.grid_error(record) == 0);
    CHECK(world.inbox().healths.back().ignored == std::size(junk));
    CHECK(world.inbox().logs.size() == std::size(junk));
}

TEST_CASE("board: cameras start and stop by their bits") {
    for (std::uint8_t mask = 1; mask < 16; ++mask) {
        Cameras bench(4);
        bench.configure();
        bench.send(wire::Start{static_cast<std::uint8_t>(mask | 0xF0U), 0, {}});
        bench.run_for(70 * ms);
        CHECK(bench.pulsed() == mask);
        bench.send(wire::Stop{5, {}});
        bench.run_for(100 * ms);
        CHECK(bench.pulsed() == (mask & ~5U));
        bench.send(wire::Stop{10, {}});
        bench.run_for(100 * ms);
        CHECK(bench.pulsed() == 0);
    }
}

TEST_CASE("board: slaves are switched on and off by their bits") {
    const auto routed = [](const BoardBench& bench) {
        unsigned mask = 0;
        for (unsigned i = 0; i < 4; ++i)
            if (bench.port.routes.master[i] != not_routed) mask |= 1U << i;
        return mask;
    };
    for (std::uint8_t mask = 1; mask < 16; ++mask) {
        Cameras bench(3);
        bench.add_slave(0, 2);
        bench.add_slave(3, 1);
        bench.configure();
        CHECK(routed(bench) == 0);
        bench.send(wire::Start{mask, 0, {}});
        CHECK(routed(bench) == (mask & 0b1001U));
        if ((mask & 1U) != 0) CHECK(bench.port.routes.master[0] == 2);
        if ((mask & 8U) != 0) CHECK(bench.port.routes.master[3] == 1);
        CHECK_FALSE((bench.port.forced && routed(bench) != 0));
        bench.run_for(70 * ms);
        CHECK(bench.pulsed() == (mask & 0b0110U));  // none starts its master
        bench.send(wire::Stop{0b0011, {}});
        CHECK(routed(bench) == (mask & 0b1000U));
        bench.run_for(100 * ms);
        CHECK(bench.pulsed() == (mask & 0b0100U));
        bench.send(wire::Stop{0b1100, {}});
        CHECK(routed(bench) == 0);
        // Off with a new configuration, too.
        bench.send(wire::Start{0b1001, 0, {}});
        CHECK(routed(bench) == 0b1001);
        bench.greet();
        bench.run_for(second);
        CHECK(routed(bench) == 0);
    }
}

TEST_CASE("board: a slave that cannot be switched is switched when its master has exposed") {
    Cameras bench(3);
    bench.add_slave(1, 2);
    bench.configure();
    const Routes& routes = bench.port.routes;
    const auto exposure_ends = [&bench] {
        bench.port.master_exposes = false;
        bench.edge(2, bench.port.time + ms);
        bench.edge(2, bench.port.time + 2 * ms, false);
        bench.poll(bench.port.time + 3 * ms);
    };
    // The port may know of an exposure before its edge is read; later nobody asks it.
    for (const bool known : {false, true}) {
        bench.port.master_exposes = !known;
        if (known) bench.edge(2, bench.port.time);
        bench.poll();
        bench.send(wire::Start{2, 0, {}});
        CHECK(routes.master[1] == not_routed);
        exposure_ends();
        CHECK(routes.master[1] == 2);
        bench.port.master_exposes = !known;
        if (known) bench.edge(2, bench.port.time);
        bench.poll();
        bench.send(wire::Stop{2, {}});
        CHECK(routes.master[1] == 2);
        exposure_ends();
        CHECK(routes.master[1] == not_routed);
    }
}

TEST_CASE("board: a slave that waits to be switched stays as it is when another one is switched") {
    for (const bool on : {false, true}) {
        Cameras bench(1);
        bench.add_slave(1, 0);
        bench.add_camera(2);
        bench.add_slave(3, 2);
        bench.configure();
        if (!on) bench.send(wire::Start{2, 0, {}});
        bench.port.master_exposes = true;
        if (on)
            bench.send(wire::Start{2, 0, {}});
        else
            bench.send(wire::Stop{2, {}});
        bench.port.master_exposes = false;
        bench.edge(0, bench.port.time);  // of the exposure that the port knew of
        bench.poll();
        bench.send(wire::Start{8, 0, {}});
        CHECK(bench.port.routes.master[3] == 2);
        CHECK(bench.port.routes.master[1] == (on ? not_routed : 0));
    }
}

TEST_CASE("board: the gaps of a slave are its master's") {
    const auto ticks = [](std::uint8_t master, std::uint8_t slave) {
        Cameras bench(1);
        bench.configuration.cameras[0].rate_uhz = 100'000'000;
        bench.configuration.cameras[0].flags |= wire::camera_no_strobe;
        bench.configuration.cameras[0].flags &= ~std::uint32_t{wire::camera_no_strobe};
        bench.add_slave(1, 0);
        bench.configure();
        bench.send(wire::Start{1, master, {}});
        bench.run(14 * ms);  // one pulse
        bench.port.words.clear();
        bench.send(wire::Start{2, slave, {}});
        bench.run(214 * ms);
        return bench.pulses(0).size();
    };
    const std::size_t all = 20;
    const std::size_t pattern = ticks(wire::start_pattern, wire::start_pattern);
    CHECK(ticks(0, 0) == all);
    CHECK(pattern < all);
    CHECK(ticks(0, wire::start_pattern) == pattern);  // it begins anew
    CHECK(ticks(wire::start_pattern, 0) < all);       // and goes on
    CHECK(ticks(wire::start_slow, 0) == all);         // is over
    CHECK(ticks(0, wire::start_slow) == 1);
}

TEST_CASE("board: an alignment counts up to its limits") {
    struct Case {
        Nanoseconds from_now;
        std::int32_t pace_ppb;
        std::uint32_t max_slew_ppb;
    };
    const Case good[] = {{100 * second, 0, 1000},
                         {-100 * second, 0, 1000},
                         {0, 500'000, 1000},
                         {0, -500'000, 1000},
                         {0, 0, 1},
                         {0, 0, 1'000'000}};
    const Case bad[] = {{100 * second + 1, 0, 1000},
                        {-100 * second - 1, 0, 1000},
                        {0, 500'001, 1000},
                        {0, -500'001, 1000},
                        {0, 0, 0},
                        {0, 0, 1'000'001}};
    BoardBench bench;
    bench.configure();
    bench.run(200 * second);
    for (const bool right : {true, false}) {
        for (const Case& one : right ? good : bad)
            bench.send(
                wire::AlignGrid{bench.port.time + one.from_now, one.pace_ppb, one.max_slew_ppb});
        CHECK(bench.all<wire::Log>().size() == (right ? 0 : std::size(bad)));
        CHECK(bench.health().ignored == (right ? 0 : std::size(bad)));
    }
    CHECK(bench.all<wire::Log>()[0].level == wire::LogLevel::warning);
}

TEST_CASE(
    "board: the grid steps to the host's if nothing runs, and if it is off by more than 1 us") {
    for (const Nanoseconds off : {-1'001, -1'000, 1'000, 1'001}) {
        BoardBench bench;
        bench.configuration.ports.sync_rate_uhz = 10'000'000;
        bench.configure();
        bench.run(99'800 * us);
        const bool seen = off < -1'000 || off > 1'000;
        bench.port.words.clear();
        bench.send(wire::AlignGrid{second + off, 0, 1});  // a slew takes very long
        bench.run(450 * ms);
        const auto pulses = bench.pulses(output_sync);
        REQUIRE(pulses.size() >= 3);
        CHECK(std::abs(pulses.back() - 400 * ms - (seen ? off : 0)) <= 1);
    }
}

TEST_CASE("board: pulses go on at once where the host places the grid") {
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.run(5'150 * ms);
    bench.port.words.clear();
    bench.send(wire::AlignGrid{6'430 * ms, 0, 1'000});
    bench.run(5'450 * ms);
    CHECK(bench.pulses(output_sync) ==
          std::vector<Nanoseconds>{5'230 * ms, 5'330 * ms, 5'430 * ms});
}

TEST_CASE("board: sync pulses move with the grid") {
    Cameras bench(1);
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(150 * ms);
    bench.send(wire::AlignGrid{second + ms, 0, 1'000'000});
    bench.run(250 * ms);
    const Nanoseconds at = bench.pulses(output_sync).back();
    CHECK(std::abs(at - 200'050 * us) < us);
}

TEST_CASE("board: cameras that wait for a sync pulse wait no longer in a new configuration") {
    Cameras bench(1);
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    bench.send(wire::Start{0, wire::start_on_sync, {}});
    bench.configure();
    for (const Nanoseconds at : {second, 2 * second}) {
        bench.run(at);
        bench.edge(input_pulse + unsigned{wire::pulse_sync}, at);
    }
    bench.run(3 * second);
    CHECK(bench.pulsed() == 0);
    CHECK(bench.health().sync_state == wire::SyncState::none);
}

TEST_CASE("board: the grid begins with a sync pulse though no camera waits for it") {
    Cameras bench(1);
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.send(wire::Start{0, wire::start_on_sync, {}});
    for (const Nanoseconds at : {103 * ms, 203 * ms}) {
        bench.run(at);
        bench.edge(input_pulse + unsigned{wire::pulse_sync}, at);
    }
    bench.run(210 * ms);
    bench.send(wire::Start{1, 0, {}});
    bench.run(500 * ms);
    REQUIRE(bench.pulses(0).size() > 3);
    for (const Nanoseconds at : bench.pulses(0)) CHECK((at + 2 * ms - 203 * ms) % (50 * ms) == 0);
    CHECK(bench.health().sync_state == wire::SyncState::followed);
}

TEST_CASE("board: cameras that wait for a sync pulse are started, or stopped, by their bits") {
    const std::uint8_t slow = wire::start_on_sync | wire::start_slow;
    const std::uint8_t on_sync = wire::start_on_sync;
    struct Case {
        std::vector<std::pair<std::uint8_t, std::uint8_t>> starts;  ///< masks and flags
        std::uint8_t stopped;
        unsigned at_once, later, slow;
    };
    const Case cases[] = {{{{1, on_sync}, {4, on_sync}}, 0, 0, 5, 0},
                          {{{7, on_sync}}, 2, 0, 5, 0},
                          {{{7, slow}}, 0, 0, 7, 7},
                          {{{6, slow}, {2, 0}}, 0, 2, 6, 4},
                          {{{2, 0}, {4, on_sync}}, 0, 6, 6, 0}};
    for (const Case& one : cases) {
        Cameras bench(3);
        bench.configuration.ports.sync_rate_uhz = 10'000'000;
        bench.configure();
        for (const auto& [mask, flags] : one.starts) bench.send(wire::Start{mask, flags, {}});
        bench.send(wire::Stop{one.stopped, {}});
        bench.run(90 * ms);
        CHECK((bench.pulsed() & 0xFU) == one.at_once);
        for (const Nanoseconds at : {100 * ms, 200 * ms}) {
            bench.run(at);
            bench.edge(input_pulse + unsigned{wire::pulse_sync}, at);
        }
        bench.run(460 * ms);
        for (unsigned i = 0; i < 3; ++i)
            if ((one.later >> i & 1U) != 0)
                CHECK((bench.pulses(i).size() < 5) == ((one.slow >> i & 1U) != 0));
        CHECK((bench.pulsed() & 0xFU) == one.later);
        if (one.at_once == 0) CHECK(bench.health().sync_state == wire::SyncState::followed);
    }
}
