// SPDX-License-Identifier: BSD-3-Clause
// The board's words to the host; what it does is told by the scenarios.
#include "board.hpp"

#include <catch2/catch.hpp>

#include "adis_device.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("board: it says who it is, and what it can do") {
    World world;
    world.connect();
    REQUIRE(world.inbox().hellos.size() == 1);
    const wire::BoardHello& hello = world.inbox().hellos[0];
    CHECK(hello.major == wire::protocol_major);
    CHECK(hello.cameras == 4);
    CHECK(std::string(hello.serial) == "TEST");
    CHECK((hello.capabilities & wire::capability_slaves) != 0);
    CHECK(hello.reset_cause == wire::ResetCause::power_on);
}

TEST_CASE("board: a host of another major version is told who is there, and nothing more") {
    World world;
    world.send(wire::HostHello{wire::protocol_major + 1, 0, {}});
    world.run(100 * ms);
    REQUIRE(world.inbox().hellos.size() == 1);
    world.send(wire::ClockRequest{1, 0});
    world.run(3 * second);
    CHECK(world.inbox().packets == world.inbox().hellos.size());
}

TEST_CASE(
    "board: a clock request is answered with the instants at which it came and at which the answer "
    "left") {
    World world;
    world.connect();
    world.run(second);
    world.send(wire::ClockRequest{77, 0});
    const Nanoseconds asked = world.now();
    world.run(10 * ms);
    REQUIRE(world.inbox().clock_answers.size() == 1);
    CHECK(world.inbox().clock_answers[0].id == 77);
    CHECK(world.inbox().clock_answers[0].received_ns == asked);
    CHECK(world.inbox().clock_answers[0].sent_ns >= asked);
}

TEST_CASE("board: its health comes once a second") {
    World world;
    world.connect();
    world.run(10 * second);
    CHECK(world.inbox().healths.size() == 10);
    CHECK(world.inbox().lost == 0);
}

TEST_CASE(
    "board: when a clock answer left is told after it, also when the host was slow to take it") {
    World world;
    world.connect();
    for (const Nanoseconds stall : {Nanoseconds{0}, 300 * ms}) {
        world.inbox() = {};
        world.stall_host(stall);
        world.send(wire::ClockRequest{77, 0});
        const Nanoseconds asked = world.now();
        world.run(stall + 10 * ms);
        REQUIRE(world.inbox().clock_answers.size() == 1);
        REQUIRE(world.inbox().follow_ups.size() == 1);
        const wire::ClockFollowUp& told = world.inbox().follow_ups[0];
        CHECK(told.id == 77);
        CHECK(world.inbox().clock_answers[0].sent_ns - asked < ms);
        CHECK(told.sent_ns >= asked + stall);
        CHECK(told.sent_ns <= asked + stall + ms);
    }
}

TEST_CASE("board: each sample says how old it was when it left") {
    World world;
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 204.8, true);
    REQUIRE(world.begin());
    world.run(2 * second);
    REQUIRE(world.inbox().samples[0].size() > 200);
    for (const wire::ImuSample& sample : world.inbox().samples[0]) {
        REQUIRE(sample.departure_ns > 0);
        REQUIRE(sample.departure_ns < 2'000'000);  // read at once, and the link is free
    }
}

TEST_CASE(
    "board: the host places the grid at once while no camera runs, and slews it when one does") {
    World world;
    world.add_camera(0);
    world.gaps_allowed = true;
    world.connect();
    CHECK((world.inbox().hellos[0].capabilities & wire::capability_host_grid) != 0);
    REQUIRE(world.configure());
    const auto off = [&world](const wire::Exposure& record, Nanoseconds second_at) {
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

TEST_CASE("board: an alignment out of range is ignored, counted and told") {
    World world;
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

TEST_CASE("board: sentences at the UART name the pulses of the PPS input") {
    World world;
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
        const std::size_t before = world.inbox().events_of(wire::EventKind::pps).size();
        while (world.inbox().events_of(wire::EventKind::pps).size() == before) world.run(ms);
        pulses.push_back(world.inbox().events_of(wire::EventKind::pps).back().time_ns);
        // It begins 200 ms after the pulse, and is told of as a whole.
        const auto lasts = static_cast<Nanoseconds>(line.size()) * 10 * second / 9600;
        const std::vector<std::uint8_t> bytes(line.begin(), line.end());
        world.board().uart_receive(bytes, pulses.back() + 200 * ms + lasts);
        world.run(500 * ms);
    }
    const auto labels = world.inbox().events_of(wire::EventKind::utc_label);
    REQUIRE(labels.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
        CHECK(labels[i].time_ns == pulses[i]);
        CHECK(labels[i].value == 1'704'067'199 + static_cast<std::int64_t>(i));
    }
}

TEST_CASE("board: NMEA is refused where an IMU has the UART, or at a baud rate that nobody has") {
    World world;
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
