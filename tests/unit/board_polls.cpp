// SPDX-License-Identifier: BSD-3-Clause
// What one poll of the board does, in which order, and when it asks for the next.
#include "board.hpp"

#include <catch2/catch.hpp>
#include <memory>

#include "adis_device.hpp"
#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::firmware;

TEST_CASE("board: one poll takes four packets, and what remains is due at once") {
    BoardBench bench;
    for (unsigned id = 0; id < 5; ++id) bench.queue(wire::ClockRequest{id, 0});
    bench.poll(ms);
    CHECK(bench.port.packets.size() == 1);
    CHECK(bench.board.next_wake() <= ms);
    bench.poll();
    CHECK(bench.port.packets.empty());
    bench.run(ms);
    CHECK(bench.all<wire::ClockAnswer>().size() == 5);
}

TEST_CASE("board: it asks for what happens next, and otherwise five times a second") {
    BoardBench bench{BenchPort()};
    bench.run(0);
    CHECK(bench.board.next_wake() == 200 * ms);
    bench.poll(100 * ms);  // nobody asked for it
    CHECK(bench.board.next_wake() == 200 * ms);
    bench.run(200 * ms);
    CHECK(bench.board.next_wake() == 400 * ms);
    bench.greet();
    bench.run(1'130 * ms);
    bench.configure();
    CHECK(bench.all<wire::Health>().empty());
    CHECK(bench.board.next_wake() == 1'200 * ms);  // its health
    bench.run(1'230 * ms);
    CHECK(bench.all<wire::Health>().size() == 1);
    bench.send(wire::Stop{0, {}});
    CHECK(bench.board.next_wake() == 1'430 * ms);  // nothing is left of the configuration
}

TEST_CASE("board: the longest delay is that of what was due, since the last health") {
    BenchPort port;
    port.time = 5 * second;  // before that nothing was due
    BoardBench bench(port);
    bench.greet();
    const Nanoseconds greeted = bench.port.time;
    CHECK(bench.health().loop_max_ns == 0);
    CHECK(bench.board.next_wake() <= greeted + 1'200 * ms);
    bench.poll(bench.port.time + ms);  // before it was asked for
    const Nanoseconds due = bench.board.next_wake();
    bench.poll(due + 3 * ms);
    bench.poll(bench.board.next_wake() + 2 * ms);
    CHECK(bench.health().loop_max_ns == 3 * ms);
    CHECK(bench.health().loop_max_ns == 0);
}

TEST_CASE("board: the watchdog is fed until the outputs have been stuck for half a second") {
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    const auto fed = [&bench](Nanoseconds at) {
        const unsigned before = bench.port.fed;
        bench.poll(at);
        return bench.port.fed > before;
    };
    bench.run(98 * ms);
    bench.send(wire::Stop{0, {}});  // the outputs are looked at, and nothing is due
    bench.port.outputs_full = true;
    bench.run(100 * ms);
    CHECK(fed(598 * ms - 1));
    CHECK_FALSE(fed(598 * ms));
    CHECK_FALSE(fed(second));
    bench.port.outputs_full = false;
    CHECK(fed(second + ms));
}

TEST_CASE("board: a queue of the hardware that is full is not asked again before a word leaves") {
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.port.outputs_full = true;
    bench.run(99'900 * us);
    CHECK(bench.board.next_wake() > 150 * ms);
    bench.port.outputs_full = false;
    bench.poll(99'950 * us);
    REQUIRE(bench.pulses(output_sync).size() == 1);
    CHECK(bench.pulses(output_sync)[0] == 100 * ms);
}

TEST_CASE(
    "board: an output that is late is reported, counted, and moves the record of its trigger") {
    for (const std::uint32_t flags : {0U, std::uint32_t{wire::camera_trigger_inverted}}) {
        Cameras bench(4, wire::camera_no_strobe | flags);
        bench.configure();
        bench.port.late = 100 * us;  // the pulse begins when it should end
        bench.send(wire::Start{8, 0, {}});
        bench.run(60 * ms);
        const auto late = bench.events(wire::BoardEventKind::output_late);
        REQUIRE(late.size() == 2);  // both edges
        CHECK(late[0].source == 3);
        CHECK(late[0].time_ns == 48 * ms);
        CHECK(late[0].value == 100 * us);
        CHECK(late[1].time_ns == 48'100 * us);
        CHECK(late[1].value == 200 * us);
        const auto records = bench.all<wire::Exposure>();
        REQUIRE(records.size() == 1);
        CHECK(records[0].camera == 3);
        CHECK(records[0].trigger_ns == 48'100 * us);
        CHECK((records[0].flags & wire::exposure_late) != 0);
        const std::uint32_t counted = bench.health().late_outputs;
        CHECK(counted == bench.events(wire::BoardEventKind::output_late).size());
    }
}

TEST_CASE("board: an output that leaves later by rounding is not late, and its record is exact") {
    BenchPort port;
    port.facts.output_step = 16;
    port.late = 1;
    BoardBench bench(port);
    bench.greet();
    bench.add_camera(0, wire::camera_no_strobe);
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(60 * ms);
    const auto records = bench.all<wire::Exposure>();
    REQUIRE(records.size() == 1);
    CHECK(records[0].trigger_ns == 48 * ms + 1);
    CHECK((records[0].flags & wire::exposure_late) == 0);
    CHECK(bench.events(wire::BoardEventKind::output_late).empty());
    CHECK(bench.health().late_outputs == 0);
}

TEST_CASE("board: what is due leaves before the edges that a late poll has to look through") {
    Cameras bench(1);
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(60 * ms);
    const Nanoseconds due = bench.trigger() + 50 * ms;
    bench.run(due - 700 * us);
    bench.port.pushed.clear();
    for (int i = 0; i < 4; ++i)
        bench.edge(input_pulse + unsigned{wire::pulse_aux0}, due - 500 * us + i * 100 * us);
    bench.port.edge_takes = 200 * us;
    bench.poll(due - 10 * us);
    CHECK(bench.trigger() == due);
    REQUIRE_FALSE(bench.port.pushed.empty());
    CHECK(bench.port.pushed[0] == due - 10 * us);
}

TEST_CASE("board: an exposure that does not come is reported as soon as all edges are known") {
    const auto told_after = [](Nanoseconds edge_lag) {
        Cameras bench(1);
        bench.port.edge_lag = edge_lag;
        bench.configuration.cameras[0].rate_uhz = 2'000'000;
        bench.configure();
        bench.run(10 * second);
        bench.send(wire::Start{1, 0, {}});
        while (bench.all<wire::Exposure>().empty()) bench.run(bench.board.next_wake());
        const wire::Exposure record = bench.all<wire::Exposure>()[0];
        CHECK(record.start_ns == wire::no_time);
        return bench.port.time - record.trigger_ns;
    };
    const Nanoseconds at_once = told_after(0);
    CHECK(told_after(300 * us) >= at_once + 300 * us);
    CHECK(told_after(300 * us) <= at_once + 400 * us);
}

TEST_CASE("board: a sample leaves as soon as the edges of its time are known") {
    PortModel model;
    model.edge_lag_ns = 300 * us;
    scenario::World world(1, model);
    world.add_imu(std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b,
                                                        &scenario::World::motion),
                  wire::ImuKind::adis16448b, 102.4, true);
    REQUIRE(world.begin());
    world.run(second);
    REQUIRE(world.inbox().samples[0].size() > 50);
    for (const wire::ImuSample& sample : world.inbox().samples[0])
        REQUIRE(sample.departure_ns < 2'000'000);
}

TEST_CASE("board: after a pause, nobody waits for what a trigger did that has not left yet") {
    Cameras bench(1);
    bench.configuration.illumination = {1, 0, 0, 1'000'000, 20'000'000, 500'000};
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(46'100 * us);  // it is decided, because of the light's lead
    bench.port.late = 70 * ms;
    bench.poll(118 * ms);
    bench.send(wire::Stop{1, {}});
    bench.edge(0, 118 * ms);
    bench.edge(0, 122 * ms, false);
    bench.run(130 * ms);
    const auto records = bench.all<wire::Exposure>();
    REQUIRE(records.size() == 1);
    CHECK(records[0].trigger_ns == 118 * ms);
    CHECK(records[0].flags == (wire::exposure_measured | wire::exposure_late));
}

TEST_CASE("board: stray edges are all counted, and reported ten times a second") {
    BoardBench bench;
    bench.add_camera(0);
    bench.configure();
    for (Nanoseconds at = 10 * ms; at < 220 * ms; at += 20 * ms) {
        bench.edge(0, at, (at / ms) % 40 == 10);
        bench.poll(at + ms);
    }
    std::vector<Nanoseconds> reported;
    const auto events = bench.events(wire::BoardEventKind::stray_edge);
    for (const wire::Event& event : events) reported.push_back(event.time_ns);
    CHECK(reported == std::vector<Nanoseconds>{10 * ms, 110 * ms, 210 * ms});
    for (std::size_t i = 0; i < events.size(); ++i) CHECK(events[i].sequence == i);
    CHECK(bench.health().stray_edges == 11);
}

TEST_CASE("board: an input that was ignored is listened to again a second later") {
    BoardBench bench;
    bench.configure();
    bench.run(150 * ms);
    const std::uint8_t aux0 = input_pulse + unsigned{wire::pulse_aux0};
    const auto listens = [&] { return (bench.port.inputs >> aux0 & 1U) != 0; };
    for (int i = 0; i < 140; ++i) bench.edge(aux0, 150 * ms + i * us);
    bench.run(151 * ms);
    bench.send(wire::Stop{0, {}});
    CHECK_FALSE(listens());
    bench.run(180 * ms);
    bench.send(wire::Stop{0, {}});
    while (!listens()) bench.run(bench.board.next_wake());
    CHECK(bench.port.time >= 1'150 * ms);
    CHECK(bench.port.time <= 1'152 * ms);
}
