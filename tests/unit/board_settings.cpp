// SPDX-License-Identifier: BSD-3-Clause
// How a configuration is refused, waits, comes into force, and is kept.
#include "board.hpp"

#include <catch2/catch.hpp>
#include <memory>

#include "adis_device.hpp"
#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::firmware;

namespace {

std::vector<std::uint8_t> wire_bytes(const wire::Configuration& configuration) {
    std::vector<std::uint8_t> bytes(sizeof configuration);
    std::memcpy(bytes.data(), &configuration, sizeof configuration);
    return bytes;
}

}  // namespace

TEST_CASE("board: each sample says how old it was when it left") {
    scenario::World world;
    world.add_imu(std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b,
                                                        &scenario::World::motion),
                  wire::ImuKind::adis16448b, 204.8, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    REQUIRE(world.inbox().samples[0].size() > 200);
    for (const wire::ImuSample& sample : world.inbox().samples[0]) {
        REQUIRE(sample.departure_ns > 0);
        REQUIRE(sample.departure_ns < 2'000'000);  // read at once, and the link is free
    }
}

TEST_CASE("board: sentences at the UART name the pulses of the PPS input") {
    scenario::World world;
    world.add_pulses(wire::pulse_pps, 300 * ms, 1e9);
    world.configuration.ports.options = wire::port_nmea;
    world.connect();
    CHECK((world.inbox().hellos[0].capabilities & wire::capability_nmea) != 0);
    REQUIRE(world.configure());
    const std::string lines[] = {"$GPRMC,235959.00,A,4723.1,N,00832.4,E,0.02,31.6,311223,,,A*",
                                 "$GPRMC,000000.00,A,4723.1,N,00832.4,E,0.02,31.6,010124,,,A*"};
    std::vector<Nanoseconds> pulses;
    for (std::string line : lines) {
        unsigned sum = 0;
        for (std::size_t i = 1; i + 1 < line.size(); ++i)
            sum ^= static_cast<unsigned char>(line[i]);
        line += {"0123456789ABCDEF"[sum >> 4U], "0123456789ABCDEF"[sum & 15U], '\r', '\n'};
        const std::size_t before = world.inbox().events_of(wire::BoardEventKind::pps).size();
        while (world.inbox().events_of(wire::BoardEventKind::pps).size() == before) world.run(ms);
        pulses.push_back(world.inbox().events_of(wire::BoardEventKind::pps).back().time_ns);
        // It begins 200 ms after the pulse, and is reported as a whole.
        const auto lasts = static_cast<Nanoseconds>(line.size()) * 10 * second / 9600;
        const std::vector<std::uint8_t> bytes(line.begin(), line.end());
        world.board().uart_receive(bytes, pulses.back() + 200 * ms + lasts);
        world.run(500 * ms);
    }
    const auto labels = world.inbox().events_of(wire::BoardEventKind::utc_label);
    REQUIRE(labels.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
        CHECK(labels[i].time_ns == pulses[i]);
        CHECK(labels[i].value == 1'704'067'199 + static_cast<std::int64_t>(i));
    }
}

TEST_CASE("board: NMEA is refused where an IMU has the UART, or at a baud rate that nobody has") {
    scenario::World world;
    world.connect();
    world.configuration.ports.options = wire::port_nmea;
    world.configuration.ports.nmea_baud = 1'000;
    CHECK_FALSE(world.configure());
    REQUIRE(world.inbox().refusals.size() == 1);
    CHECK(world.inbox().refusals[0].field == wire::ConfigurationField::nmea_baud);
    world.configuration.ports.nmea_baud = 115'200;
    CHECK(world.configure());
    world.add_vn100(200, false);
    CHECK_FALSE(world.configure());
    REQUIRE(world.inbox().refusals.size() == 2);
    CHECK(world.inbox().refusals[1].field == wire::ConfigurationField::port_options);
}

TEST_CASE("board: a configuration that is refused changes nothing, and reports each reason") {
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    const wire::Configuration good = bench.configuration;
    for (std::uint32_t id : {7U, 8U}) {
        bench.configuration.id = id;
        bench.configuration.ports.sync_rate_uhz = 1;
        bench.configuration.ports.pulse_ns = 1;
        bench.configuration.ports.inputs = 0;
        const std::size_t before = bench.all<wire::Refusal>().size();
        bench.send(bench.configuration);
        bench.run(bench.port.time + ms);
        const auto refusals = bench.all<wire::Refusal>();
        REQUIRE(refusals.size() == before + 2);
        for (const auto& refusal : {refusals[before], refusals[before + 1]})
            CHECK(refusal.id == id);
        const wire::ConfigurationAnswer answer = bench.all<wire::ConfigurationAnswer>().back();
        CHECK(answer.id == id);
        CHECK(answer.status == wire::ConfigurationStatus::refused);
        CHECK(answer.refused == 2);
        CHECK(answer.taken.ports.inputs == 0xF);
        CHECK(bench.port.inputs == 0xF0U << 2U);
    }
    bench.configuration = good;
    CHECK(bench.configure().refused == 0);
    bench.configuration.id = 99;
    bench.add_camera(0);
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.send(bench.configuration);
    bench.run(bench.port.time + ms);
    const auto answer = bench.all<wire::ConfigurationAnswer>().back();
    CHECK(answer.id == 99);
    CHECK(answer.status == wire::ConfigurationStatus::running);
    CHECK(answer.refused == 0);
}

TEST_CASE("board: no configuration while cameras run, be they slaves alone") {
    for (const std::uint8_t mask : {1, 2, 3}) {
        Cameras bench(1);
        bench.add_slave(1, 0);
        bench.configure();
        bench.send(wire::Start{mask, 0, {}});
        bench.send(bench.configuration);
        bench.run(10 * ms);
        CHECK(bench.all<wire::ConfigurationAnswer>().back().status ==
              wire::ConfigurationStatus::running);
        bench.send(wire::Stop{mask, {}});
        bench.configure();
    }
}

TEST_CASE("board: a configuration is answered with the grid's origin and the rates as they are") {
    BoardBench bench;
    add_imus(bench, 0);
    bench.configuration.id = 1234;
    bench.run(100 * ms);
    bench.configuration.illumination = {1, 0, 0, 3'001, 20'000'000, 500'000};
    const wire::ConfigurationAnswer answer = bench.configure();
    CHECK(answer.id == 1234);
    CHECK(answer.origin_ns == 100 * ms);
    wire::Configuration taken = bench.configuration;
    for (std::size_t i = 0; i < wire::imu_count; ++i)
        taken.imus[i].rate_millihertz = answer.taken.imus[i].rate_millihertz;
    CHECK(wire_bytes(answer.taken) == wire_bytes(taken));
    CHECK(answer.taken.imus[0].rate_millihertz == 400'000);  // on the board's grid
    CHECK(answer.taken.imus[1].rate_millihertz == Vn100::true_rate(300'000));
    CHECK(answer.taken.imus[1].rate_millihertz != 300'000);
    add_imus(bench, wire::imu_data_ready);
    CHECK(bench.configure().taken.imus[0].rate_millihertz ==
          SpiImu::true_rate(bench.configuration.imus[0]));
    bench.configuration.imus[1] = {wire::ImuKind::none, 0, 0, 0, 77};
    CHECK(bench.configure().taken.imus[1].rate_millihertz == 77);
}

TEST_CASE("board: an IMU is set up when its part of the configuration changed, and only then") {
    BoardBench bench;
    add_imus(bench, wire::imu_data_ready);
    bench.run(10 * second);
    const auto set_up = [&bench] {
        bench.port.uart.baud = bench.port.disarmed = 0;
        bench.configure();
        bench.run(bench.port.time + us);
        return std::pair(bench.port.disarmed > 0, bench.port.uart.baud > 0);
    };
    CHECK(set_up() == std::pair(true, true));
    CHECK(set_up() == std::pair(false, false));
    bench.add_camera(0);
    CHECK(set_up() == std::pair(false, false));
    bench.configuration.imus[0].filter = 1;
    CHECK(set_up() == std::pair(true, false));
    bench.configuration.imus[1].options = 0;
    CHECK(set_up() == std::pair(false, true));
    bench.configuration.imus[0].rate_millihertz = 100'000;
    CHECK(set_up() == std::pair(true, false));
    bench.configuration.imus[1].rate_millihertz = 100'000;
    CHECK(set_up() == std::pair(false, true));
    CHECK(set_up() == std::pair(false, false));
}

TEST_CASE("board: a configuration waits for exposures, and for no more than 200 ms") {
    for (const bool ends : {true, false}) {
        Cameras bench(2);
        bench.configuration.cameras[1].max_exposure_ns = second;
        bench.configuration.illumination = {2, 0, 0, 0, 1'000'000'000, 1'000'000};
        bench.configuration.ports.sync_rate_uhz = 10'000'000;
        bench.configuration.ports.test = wire::test_rate;
        bench.configuration.ports.test_rate_millihertz = 10'000;
        bench.configure();
        bench.send(wire::Start{2, 0, {}});
        bench.run(48 * ms);
        bench.edge(1, 48 * ms);
        bench.run(50 * ms);
        bench.send(wire::Stop{2, {}});
        bench.send(bench.configuration);
        const auto answered = [&bench](Nanoseconds at) {
            bench.run(at);
            return bench.all<wire::ConfigurationAnswer>().size() > 1;
        };
        bench.pulsed();
        CHECK_FALSE(answered(100 * ms));
        bench.send(wire::Start{1, 0, {}});  // it belongs to the configuration before
        if (ends) bench.edge(1, 100 * ms, false);
        CHECK_FALSE(answered(100 * ms + 4 * us));
        CHECK(answered(101 * ms) == ends);
        if (!ends) {
            CHECK_FALSE(answered(250 * ms - 1));
            CHECK(bench.pulsed() == 0);
            CHECK(bench.board.next_wake() == 250 * ms);
            bench.poll(250 * ms);
            CHECK(bench.board.next_wake() == 250 * ms);  // now it is dark
        }
        CHECK(answered(250 * ms));
        CHECK(bench.port.levels_when_routed == 0);  // it is dark
        const auto records = bench.all<wire::Exposure>();
        REQUIRE(records.size() == 1);
        CHECK(records[0].camera == 1);
        CHECK((records[0].flags & wire::exposure_no_end) == (ends ? 0 : wire::exposure_no_end));
        bench.pulsed();
        bench.run_for(200 * ms);
        CHECK(bench.pulsed() == (1U << output_sync | 1U << output_test));
    }
}

TEST_CASE("board: a slave that a new configuration cuts off does not run in it") {
    for (const bool still_slave : {false, true}) {
        Cameras bench(1);
        bench.configuration.cameras[0].max_exposure_ns = second;
        bench.add_slave(1, 0);
        bench.configure();
        bench.send(wire::Start{3, 0, {}});
        bench.run(48 * ms);
        bench.edge(0, 48 * ms);  // it does not end
        bench.run(50 * ms);
        bench.send(wire::Stop{3, {}});
        if (!still_slave) bench.add_camera(1);
        bench.send(bench.configuration);
        bench.run(300 * ms);
        CHECK(bench.all<wire::ConfigurationAnswer>().size() == 2);
        CHECK(bench.port.routes.master[1] == not_routed);
        bench.pulsed();
        bench.send(wire::AlignGrid{second, 0, 1000});
        bench.run(500 * ms);
        CHECK(bench.pulsed() == 0);
        bench.configure();
        bench.send(wire::Start{2, 0, {}});  // the exposure is of the configuration before
        CHECK(bench.port.routes.master[1] == (still_slave ? 0 : not_routed));
    }
}

TEST_CASE("board: pulses of the old configuration end before the new one is in force") {
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configuration.ports.test = wire::test_rate;
    bench.configuration.ports.test_rate_millihertz = 10'000;
    bench.configuration.ports.pulse_ns = 10'000'000;
    bench.configure();
    bench.run(104 * ms);  // both outputs are high
    REQUIRE(bench.port.words.back().second == (1U << output_sync | 1U << output_test));
    bench.send(bench.configuration);
    bench.poll();
    bench.run(105 * ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 2);
    CHECK(bench.port.words.back().second == 0);
    CHECK(bench.port.words.back().first <= 105 * ms);
    CHECK(bench.port.levels_when_routed == 0);
    bench.run(210 * ms);
    const Nanoseconds origin = bench.all<wire::ConfigurationAnswer>().back().origin_ns;
    CHECK(bench.pulses(output_sync).back() == origin + 100 * ms);
    CHECK(bench.pulses(output_test).back() == 200 * ms);
}

TEST_CASE("board: a configuration that is to be kept is stored, and reported when it is safe") {
    BoardBench bench;
    bench.configure();
    CHECK(bench.port.stored.empty());
    bench.configuration.flags = wire::configuration_store;
    for (const bool safe : {true, false}) {
        bench.configuration.id += 5;
        bench.port.outcome = Persist::Outcome::busy;
        bench.configure();
        CHECK(bench.port.stored == wire_bytes(bench.configuration));
        bench.run(bench.port.time + 300 * ms);
        const std::size_t before = bench.events(wire::BoardEventKind::stored).size();
        CHECK(before == (safe ? 0 : 1));
        bench.port.outcome = safe ? Persist::Outcome::stored : Persist::Outcome::failed;
        const Nanoseconds at = bench.port.time + ms;
        bench.poll(at);
        bench.run(at + second);
        const auto events = bench.events(wire::BoardEventKind::stored);
        REQUIRE(events.size() == before + 1);
        CHECK(events.back().source == 0);
        CHECK(events.back().value == (safe ? 1 : 0));
        CHECK(events.back().time_ns == at);
    }
}

TEST_CASE("board: what was stored is in force from power-up, if it is whole and fits the board") {
    BenchPort port;
    port.time = 3 * second;
    wire::Configuration kept = BoardBench().configuration;
    kept.ports.sync_rate_uhz = 10'000'000;
    port.stored = wire_bytes(kept);
    BoardBench bench(port);
    CHECK(bench.port.inputs == 0xF0U << 2U);
    bench.run(3 * second + 150 * ms);
    CHECK(bench.pulses(output_sync) == std::vector<Nanoseconds>{3 * second + 100 * ms});
    BenchPort cut = port;
    cut.stored.pop_back();
    CHECK(BoardBench(cut).port.inputs == 0);
    BenchPort longer = port;
    longer.stored.push_back(0);
    CHECK(BoardBench(longer).port.inputs == 0);
    BenchPort small = port;
    small.facts.present = 0;
    BoardBench lacking(small);
    CHECK(lacking.port.inputs == 0);
    lacking.greet();
    lacking.run(4 * second);
    CHECK(lacking.all<wire::Refusal>().empty());
    lacking.configuration = {};
    CHECK(lacking.configure().refused == 0);
}
