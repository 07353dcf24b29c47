// SPDX-License-Identifier: BSD-3-Clause
#include "board_bench.hpp"

#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr std::uint8_t pps = input_pulse + unsigned{wire::pulse_pps};
constexpr std::uint8_t aux0 = input_pulse + unsigned{wire::pulse_aux0};
constexpr std::uint8_t aux1 = input_pulse + unsigned{wire::pulse_aux1};
constexpr std::uint8_t sync_in = input_pulse + unsigned{wire::pulse_sync};

/// Camera 0 runs, and a pulse of it has begun.
struct RunningInputs : BoardBench {
    RunningInputs() {
        add_camera(0);
        add_slave(1, 0);
        configure();
        send(wire::Start{1, 0, {}});
        while (trigger() == 0) poll(board.next_wake());
        began = trigger();
        run(began + us);
    }
    wire::Exposure first_record() {
        run(began + 200 * ms);
        const auto records = all<wire::Exposure>();
        REQUIRE_FALSE(records.empty());
        return records[0];
    }
    Nanoseconds began = 0;
};

/// Camera 0 follows camera 1, of which a pulse has begun.
struct Following : BoardBench {
    Following() {
        add_camera(0, wire::camera_slave);
        add_camera(1);
        configuration.cameras[0].master = 1;
        configuration.cameras[0].glitch = 1;
        configure();
        send(wire::Start{3, 0, {}});
        next_pulse();
    }
    void next_pulse() {
        const std::size_t before = pulses(1).size();
        while (pulses(1).size() == before) poll(board.next_wake());
        began = pulses(1).back();
        poll(began);
    }
    std::vector<wire::Exposure> records_of_slave() {
        run(began + 40 * ms);
        std::vector<wire::Exposure> records = all<wire::Exposure>();
        records.erase(std::remove_if(records.begin(), records.end(),
                                     [](const auto& record) { return record.camera != 0; }),
                      records.end());
        return records;
    }
    Nanoseconds began = 0;
};

}  // namespace

TEST_CASE("board_inputs: each pulse is an event, with the number of its input") {
    BoardBench bench;
    bench.configuration.ports.falling = 1U << wire::pulse_aux1;
    bench.configure();
    CHECK(bench.port.inputs == 0xFU << input_pulse);
    for (const std::uint8_t input : {pps, aux0, aux1, sync_in, pps, aux1, aux1}) {
        const Nanoseconds at = bench.port.time + 2 * ms;
        bench.edge(input, at);
        bench.edge(input, at + 100 * us, false);
        bench.poll(at + ms);
    }
    struct Pulse {
        wire::BoardEventKind kind;
        std::uint8_t source;
        std::int64_t number;
        Nanoseconds at;
    };
    const Pulse expected[] = {{wire::BoardEventKind::pps, 0, 1, 2 * ms},
                              {wire::BoardEventKind::aux_pulse, 0, 1, 5 * ms},
                              {wire::BoardEventKind::aux_pulse, 1, 1, 8 * ms + 100 * us},
                              {wire::BoardEventKind::sync_pulse, 0, 1, 11 * ms},
                              {wire::BoardEventKind::pps, 0, 2, 14 * ms},
                              {wire::BoardEventKind::aux_pulse, 1, 2, 17 * ms + 100 * us},
                              {wire::BoardEventKind::aux_pulse, 1, 3, 20 * ms + 100 * us}};
    const auto events = bench.all<wire::Event>();
    REQUIRE(events.size() == std::size(expected));
    for (std::size_t i = 0; i < events.size(); ++i) {
        CHECK(events[i].kind == expected[i].kind);
        CHECK(events[i].source == expected[i].source);
        CHECK(events[i].value == expected[i].number);
        CHECK(events[i].detail == 0);
        CHECK(events[i].time_ns == expected[i].at);
    }
}

TEST_CASE("board_inputs: echoes of pulses are no events, but counted") {
    BoardBench bench;
    bench.configure();
    for (const auto& [input, width] : {std::pair{pps, ms}, std::pair{aux0, 10 * us},
                                       std::pair{aux1, 10 * us}, std::pair{sync_in, ms}}) {
        const Nanoseconds at = bench.port.time + ms;
        for (const Nanoseconds after : {Nanoseconds{0}, width - 1, width, 2 * width - 1})
            bench.edge(input, at + after);
        bench.poll(at + 3 * ms);
    }
    CHECK(bench.all<wire::Event>().size() == 8);
    CHECK(bench.health().glitches == 8);
}

TEST_CASE("board_inputs: one poll takes a bounded number of edges, and the rest is due at once") {
    BoardBench bench;
    bench.configure();
    for (int i = 0; i < 30; ++i) bench.edge(aux0, 10 * ms + i * 20 * us);
    bench.poll(11 * ms);
    CHECK(bench.port.edges.size() == 6);
    CHECK(bench.board.next_wake() <= bench.port.time);
    bench.run(11 * ms);
    CHECK(bench.all<wire::Event>().size() == 30);
}

TEST_CASE("board_inputs: what waits behind the edges of one poll is not given up") {
    RunningInputs world;
    // Its start is among the edges that are still to be read when it should have come.
    for (int i = 0; i < 24; ++i) world.edge(aux0, world.began + 10 * us + i * 10 * us);
    world.edge(0, world.began + 400 * us);
    world.edge(0, world.began + 4 * ms, false);
    world.poll(world.began + 80 * ms);
    CHECK(world.all<wire::Exposure>().empty());
    world.poll();
    const auto records = world.all<wire::Exposure>();
    REQUIRE_FALSE(records.empty());
    CHECK(records[0].flags == wire::exposure_measured);
}

TEST_CASE("board_inputs: an exposure counts once its edges have settled") {
    RunningInputs world;
    world.edge(0, world.began);
    world.poll(world.began + 3 * us);
    CHECK(world.board.next_wake() <= world.began + 10 * us);
    world.edge(0, world.began + 4 * ms, false);
    world.edge(0, world.began + 4 * ms + us);
    world.edge(0, world.began + 4 * ms + 2 * us, false);
    world.poll(world.began + 4 * ms + 6 * us);
    CHECK(world.all<wire::Exposure>().empty());
    CHECK(world.board.next_wake() <= world.began + 4 * ms + 20 * us);
    world.poll(world.began + 4 * ms + 7 * us);
    const auto records = world.all<wire::Exposure>();
    REQUIRE(records.size() == 1);
    CHECK(records[0].start_ns == world.began);
    CHECK(records[0].end_ns == world.began + 4 * ms);
    CHECK(records[0].flags == wire::exposure_measured);
}

TEST_CASE("board_inputs: a start that has not settled when it is due is not given up") {
    RunningInputs world;
    const Nanoseconds due = world.began + 50 * ms;  // at the latest
    world.run(due - 3 * us);
    world.edge(0, due - 2 * us);
    world.poll(due + us);
    CHECK(world.all<wire::Exposure>().empty());
    world.run(due + 10 * us);
    world.edge(0, due + ms, false);
    world.run(due + 2 * ms);
    const auto records = world.all<wire::Exposure>();
    REQUIRE_FALSE(records.empty());
    CHECK(records[0].flags == wire::exposure_measured);
    CHECK(records[0].start_ns == due - 2 * us);
}

TEST_CASE("board_inputs: where edges were lost, no start is paired with an end") {
    for (const bool ended : {false, true}) {
        RunningInputs world;
        world.edge(0, world.began);
        world.poll(world.began + 50 * us);
        world.edge(0, world.began + 4 * ms, false);
        if (ended) world.poll(world.began + 4 * ms + 50 * us);
        world.port.lost = 3;
        world.poll(world.began + 5 * ms);
        const auto events = world.events(wire::BoardEventKind::edge_overflow);
        REQUIRE(events.size() == 1);
        CHECK(events[0].source == 0);
        CHECK(events[0].value == 3);
        CHECK(events[0].time_ns == world.began + 5 * ms);
        CHECK(world.first_record().flags ==
              (ended ? wire::exposure_measured : wire::exposure_no_end));
        CHECK(world.health().lost_edges == 3);
    }
}

TEST_CASE("board_inputs: no start that waited while edges were lost is paired with a later end") {
    for (const int others : {0, 22, 23, 24, 60}) {
        RunningInputs world;
        for (int i = 0; i < others; ++i) world.edge(aux0, world.began - 10 * us);
        world.edge(0, world.began);
        world.edge(aux0, world.began + 10 * us);  // it has settled
        world.port.lost = 1;
        world.run(world.began + 50 * us);
        world.edge(0, world.began + 4 * ms, false);
        world.run(world.began + 5 * ms);
        CHECK((world.first_record().flags & wire::exposure_measured) == 0);
        // That is over with what waited.
        const Nanoseconds next = world.trigger();
        const std::size_t before = world.all<wire::Exposure>().size();
        world.edge(0, next);
        world.poll(next + 50 * us);
        world.edge(0, next + 4 * ms, false);
        world.run(next + 5 * ms);
        REQUIRE(world.all<wire::Exposure>().size() > before);
        CHECK(world.all<wire::Exposure>().back().flags == wire::exposure_measured);
    }
}

TEST_CASE("board_inputs: lost edges leave the light on for as long as an exposure may come") {
    BoardBench bench;
    bench.add_camera(0);
    bench.configuration.illumination.cameras = 1;
    bench.configuration.illumination.lead_ns = 100'000;
    bench.configuration.illumination.max_on_ns = 20'000'000;
    bench.configuration.illumination.duty_ppm = 500'000;
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(48 * ms);
    bench.edge(0, 48 * ms);
    bench.poll(48 * ms + 100 * us);
    bench.port.lost = 1;
    bench.poll(48 * ms + 200 * us);
    bench.run(60 * ms);
    REQUIRE_FALSE(bench.port.words.empty());
    const auto& [at, levels] = bench.port.words.back();
    CHECK(at == 49'900 * us);
    CHECK((levels >> output_light_gate & 1U) == 0);
}

TEST_CASE("board_inputs: a slave is switched when its master does not expose, as far as is known") {
    for (const bool lost : {false, true}) {
        RunningInputs world;
        const auto switched = [&world] { return world.port.routes.master[1] == 0; };
        world.edge(0, world.began);
        world.poll(world.began + ms);
        world.send(wire::Start{2, 0, {}});
        CHECK_FALSE(switched());
        if (lost) {
            // Its end may be among them: the port knows, and is asked at the next occasion.
            world.port.lost = 1;
            world.poll(world.began + 2 * ms);
            world.send(wire::Start{2, 0, {}});
        } else {
            world.edge(0, world.began + 4 * ms, false);
            world.poll(world.began + 5 * ms);
        }
        CHECK(switched());
    }
}

TEST_CASE("board_inputs: a slave is switched at an edge of its master, not of another camera") {
    BoardBench bench;
    bench.add_camera(0);
    bench.add_slave(1, 0);
    bench.add_camera(2);
    bench.configure();
    bench.edge(0, ms);
    bench.edge(2, ms + 10 * us);
    bench.poll(2 * ms);
    bench.send(wire::Start{2, 0, {}});
    bench.edge(2, 3 * ms, false);
    bench.poll(4 * ms);
    CHECK(bench.port.routes.master[1] == not_routed);
    bench.edge(0, 5 * ms, false);
    bench.poll(6 * ms);
    CHECK(bench.port.routes.master[1] == 0);
}

TEST_CASE("board_inputs: a slave has the master's edges, and its grid point") {
    RunningInputs world;
    world.send(wire::Start{2, 0, {}});
    world.edge(0, world.began);
    world.edge(0, world.began + 4 * ms, false);
    world.poll(world.began + 10 * ms);
    const auto records = world.all<wire::Exposure>();
    // The slave was switched on after this pulse had begun.
    REQUIRE(records.size() == 1);
    world.run(world.began + 50 * ms + us);
    const Nanoseconds next = world.trigger();
    REQUIRE(next > world.began);
    world.edge(0, next);
    world.edge(0, next + 4 * ms, false);
    world.poll(next + 10 * ms);
    const auto both = world.all<wire::Exposure>();
    REQUIRE(both.size() == 3);
    CHECK(both[1].camera == 0);
    CHECK(both[2].camera == 1);
    CHECK(both[2].trigger == 1);
    CHECK(both[2].tick == both[1].tick);
    CHECK(both[2].tick == both[0].tick + 1);
    CHECK(both[2].start_ns == next);
    CHECK(both[2].end_ns == next + 4 * ms);
}

TEST_CASE("board_inputs: what a slave does while its master's line bounces is of that exposure") {
    for (const Nanoseconds delay : {Nanoseconds{0}, 1 * us}) {
        Following world;
        const Nanoseconds at = world.began + 10 * us;
        world.edge(0, at - 5 * us + delay);  // of which the master knows nothing
        world.edge(0, at - 4 * us + delay, false);
        if (delay == 0) world.edge(0, at);  // stamped at once
        world.edge(1, at);
        if (delay != 0) world.edge(0, at + delay);
        world.edge(1, at + 4 * us, false);
        world.edge(1, at + 5 * us);
        world.edge(0, at + 7 * us, false);
        world.edge(1, at + 4 * ms, false);
        const auto records = world.records_of_slave();
        REQUIRE(records.size() == 1);
        CHECK(records[0].flags == wire::exposure_measured);
        CHECK(records[0].trigger_ns == at);
        CHECK(records[0].start_ns == at + delay);
        CHECK(records[0].end_ns == at + 7 * us);
        CHECK(world.health().stray_edges == 2);
    }
}

TEST_CASE("board_inputs: edges that wait for too long behind a line that bounces are lost") {
    for (const unsigned pairs : {4U, 5U}) {
        Following world;
        const Nanoseconds at = world.began + 10 * us;
        for (unsigned i = 0; i < 2 * pairs; ++i) {
            world.edge(1, at + i * 4 * us, i % 2 == 0);
            world.edge(0, at + i * 4 * us + us, i % 2 == 0);
        }
        world.edge(1, at + 2 * pairs * 4 * us);
        world.edge(1, at + 4 * ms, false);
        CHECK(world.records_of_slave().size() == (pairs == 4 ? 1 : 0));
        world.next_pulse();
        world.edge(1, world.began);
        world.edge(1, world.began + 4 * ms, false);
        world.next_pulse();
        REQUIRE_FALSE(world.records_of_slave().empty());
        CHECK((world.records_of_slave().back().flags & wire::exposure_uncounted) ==
              (pairs == 4 ? 0 : wire::exposure_uncounted));
    }
}

TEST_CASE("board_inputs: a noisy input is reported, and spoils the exposures only of the cameras") {
    for (const std::uint8_t input : {std::uint8_t{0}, std::uint8_t{input_imu_ready}, aux0}) {
        RunningInputs world;
        world.edge(0, world.began);
        world.edge(aux1, world.began + 10 * us);
        for (int i = 0; i < 165; ++i)
            world.edge(input, world.began + 20 * us + i * 2 * us, i % 2 != 0);
        world.run(world.began + 3 * ms);
        const auto events = world.events(wire::BoardEventKind::input_noisy);
        REQUIRE(events.size() == 1);
        CHECK(events[0].source == input);
        CHECK(events[0].value == 0);
        CHECK((world.port.inputs >> input & 1U) == 0);
        if (input != 0) {
            world.edge(0, world.began + 4 * ms, false);
            world.poll(world.began + 5 * ms);
        }
        CHECK(world.first_record().flags ==
              (input != 0 ? wire::exposure_measured : wire::exposure_no_end));
        CHECK(world.health().noisy_inputs == 1);
    }
}

TEST_CASE("board_inputs: a start that waits for a sync pulse begins with the second of a pair") {
    for (const std::uint32_t rate_uhz : {0U, 10'000'000U})
        for (const Nanoseconds off : {-1, 0, 1}) {
            BoardBench bench;
            bench.add_camera(0);
            bench.configuration.ports.sync_rate_uhz = rate_uhz;
            bench.configure();
            bench.send(wire::Start{1, wire::start_on_sync, {}});
            const Nanoseconds period = rate_uhz == 0 ? second : second / 10;
            const Nanoseconds limit = period / 2'000;
            // 500 ppm off is a pulse of another clock; a nanosecond more is not.
            for (const Nanoseconds sign : {-1, 1}) {
                if (off == 0) break;
                const Nanoseconds at = bench.port.time + 200 * ms;
                const Nanoseconds next = at + period + sign * (limit + (off > 0 ? 1 : 0));
                bench.edge(sync_in, at);
                bench.edge(sync_in, next);
                bench.port.words.clear();
                bench.run(next + 50 * ms);
                CHECK((bench.trigger() > 0) == (off < 0));
                if (off > 0) continue;
                bench.run(next + 60 * ms);
                // The grid begins with the pulse, at the sender's pace.
                CHECK(bench.trigger() == next + 50 * ms + sign * 25 * us - 2 * ms);
                break;
            }
            if (off != 0) continue;
            bench.edge(sync_in, 400 * ms);  // alone
            bench.run(450 * ms);
            CHECK(bench.trigger() == 0);
        }
    BoardBench bench;
    bench.add_camera(0);
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    for (const Nanoseconds at : {200 * ms, 1'200 * ms + 500 * us}) {
        bench.run(at);
        bench.edge(sync_in, at);
        bench.poll(at + 10 * us);
    }
    bench.run(1'260 * ms);
    CHECK(bench.trigger() == 1'248 * ms + 525 * us);
}

TEST_CASE("board_inputs: a camera that waits for a sync pulse joins those that run at once") {
    BoardBench bench;
    bench.add_camera(0);
    bench.add_camera(1);
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    bench.send(wire::Start{2, 0, {}});
    bench.run(100 * ms);
    CHECK(bench.trigger() == 0);
    const auto running = bench.port.words.size();
    CHECK(running > 0);
    bench.edge(sync_in, 110 * ms);
    bench.run(200 * ms);
    CHECK(bench.trigger() % (50 * ms) == 48 * ms);
}

TEST_CASE("board_inputs: what is on the grid goes on from a sync pulse") {
    BoardBench bench;
    bench.add_camera(0);
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    for (const Nanoseconds at : {203 * ms, 303 * ms + 10 * us, 403 * ms + 20 * us}) {
        bench.run(at);
        bench.edge(sync_in, at);
        bench.poll(at + 10 * us);
    }
    bench.run(460 * ms);
    // The sender's clock is slower by 100 ppm, as is known from the second pulse on.
    CHECK(bench.trigger() == 453 * ms + 25 * us - 2 * ms);
    bool synced = false;
    for (const auto& [at, levels] : bench.port.words)
        synced = synced || (at == 403 * ms + 20 * us && (levels >> output_sync & 1U) != 0);
    CHECK(synced);
}

TEST_CASE("board_inputs: sync pulses that no longer fit the grid are reported, and then followed") {
    BoardBench bench;
    bench.add_camera(0);
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    Nanoseconds at = 200 * ms;
    for (int i = 0; i < 3; ++i, at += second) {
        bench.edge(sync_in, at);
        bench.run(at + ms);
    }
    CHECK(bench.events(wire::BoardEventKind::sync_lost).empty());
    at += 10 * ms;
    for (int i = 0; i < 3; ++i, at += second) {
        bench.edge(sync_in, at);
        bench.run(at + ms);
    }
    const auto lost = bench.events(wire::BoardEventKind::sync_lost);
    const auto taken = bench.events(wire::BoardEventKind::sync_taken);
    REQUIRE(lost.size() == 1);
    REQUIRE(taken.size() == 1);
    CHECK(lost[0].source == 0);
    CHECK(taken[0].source == 0);
    CHECK(lost[0].value == 10 * ms);
    CHECK(lost[0].time_ns == 3'210 * ms);
    CHECK(taken[0].value == 10 * ms);
    CHECK(taken[0].time_ns == 5'210 * ms);
}

TEST_CASE("board_inputs: sentences are read at their rate, and name the pulse before they began") {
    for (const std::uint32_t baud : {0U, 19'200U}) {
        BoardBench bench;
        bench.configuration.ports.options = wire::port_nmea;
        bench.configuration.ports.nmea_baud = baud;
        bench.configure();
        CHECK(bench.port.uart.baud == (baud == 0 ? 9'600 : baud));
        const std::string line =
            "$GPRMC,235959.00,A,4723.1,N,00832.4,E,0.02,31.6,311223,,,A*57\r\n";
        bench.port.uart.bytes.assign(line.begin(), line.end());
        bench.port.uart.byte = 10 * second / bench.port.uart.baud;
        const auto lasts = static_cast<Nanoseconds>(line.size()) * bench.port.uart.byte;
        // It began two bytes after the pulse; the next pulse came before its end.
        const Nanoseconds pulse = 100 * ms;
        bench.port.uart.until = pulse + 2 * bench.port.uart.byte + lasts;
        bench.edge(pps, pulse);
        bench.edge(pps, pulse + 4 * bench.port.uart.byte);
        bench.poll(200 * ms);
        const auto labels = bench.events(wire::BoardEventKind::utc_label);
        REQUIRE(labels.size() == 1);
        CHECK(labels[0].source == 0);
        CHECK(labels[0].time_ns == pulse);
        CHECK(labels[0].value == 1'704'067'199);
    }
    BoardBench bench;
    bench.configure();
    CHECK(bench.port.uart.baud == 0);
    bench.port.uart.bytes.assign(10, '$');  // they are of another part
    bench.poll(10 * ms);
    CHECK(bench.port.uart.bytes.size() == 10);
}

TEST_CASE(
    "board_inputs: a sentence begins with its first byte, wherever that is among those read") {
    const std::string line = "$GPRMC,235959.00,A,4723.1,N,00832.4,E,0.02,31.6,311223,,,A*57\r\n";
    for (const std::size_t before : {0U, 5U, 31U, 40U})
        for (const Nanoseconds late : {0, 1}) {
            BoardBench bench;
            bench.configuration.ports.options = wire::port_nmea;
            bench.configure();
            const std::string bytes = std::string(before, 'x') + line;
            bench.port.uart.bytes.assign(bytes.begin(), bytes.end());
            bench.port.uart.byte = 10 * second / 9'600;
            const Nanoseconds begins = 300 * ms;
            bench.port.uart.until =
                begins + static_cast<Nanoseconds>(line.size()) * bench.port.uart.byte;
            bench.edge(pps, 100 * ms);
            bench.edge(pps, begins + late);
            bench.poll(500 * ms);
            bench.poll();
            const auto labels = bench.events(wire::BoardEventKind::utc_label);
            REQUIRE(labels.size() == 1);
            CHECK(labels[0].time_ns == (late == 0 ? begins : 100 * ms));
        }
}
