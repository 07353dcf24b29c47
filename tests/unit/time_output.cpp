// SPDX-License-Identifier: BSD-3-Clause
#include "time_output.hpp"

#include <catch2/catch.hpp>
#include <functional>
#include <string>

#include "board_bench.hpp"
#include "nanoseconds.hpp"

using namespace versavis;
using namespace versavis::firmware;
using namespace versavis::test;

namespace {

constexpr std::int64_t first_s = 1'798'761'590;

/// The second that begins at board time `begins`.
wire::TimeOutput message_of(Nanoseconds begins, std::int64_t utc_s = first_s) {
    wire::TimeOutput message{};
    message.board_ns = begins;
    message.utc_s = utc_s;
    message.pulse_ns = 50 * ms;
    message.baud = 9600;
    message.holdover_s = 30;
    message.sentence_delay_ms = 60;
    message.flags = wire::time_known;
    message.sentences = wire::sentence_rmc;
    message.talker[0] = 'G';
    message.talker[1] = 'P';
    return message;
}

/// The changes of the test output, with their times.
std::vector<std::pair<Nanoseconds, bool>> changes(const BoardBench& bench) {
    std::vector<std::pair<Nanoseconds, bool>> all;
    bool before = false;
    for (const auto& [at, levels] : bench.port.words) {
        const bool level = (levels >> output_test & 1U) != 0;
        if (level != before) all.emplace_back(at, level);
        before = level;
    }
    return all;
}

}  // namespace

TEST_CASE("time_output: after two messages that agree, seconds have pulses and names") {
    BoardBench bench;
    bench.send(message_of(2 * second));
    bench.run(2500 * ms);
    CHECK(changes(bench).empty());
    CHECK(bench.port.uart.sent.find(",V,") != std::string::npos);
    bench.port.uart.sent.clear();
    bench.send(message_of(3 * second + 20'000, first_s + 1));
    bench.run(4500 * ms);
    CHECK(changes(bench) ==
          std::vector<std::pair<Nanoseconds, bool>>{{3 * second + 20'000, true},
                                                    {3 * second + 20'000 + 50 * ms, false},
                                                    {4 * second + 20'000, true},
                                                    {4 * second + 20'000 + 50 * ms, false}});
    CHECK(bench.port.uart.sent.substr(0, 30) == "$GPRMC,235951.00,A,0000.0000,N");
    CHECK(bench.port.uart.baud == 9600);
    CHECK_FALSE(bench.port.uart.inverted);
    const auto reported = bench.events(wire::BoardEventKind::time_pulse);
    REQUIRE(reported.size() == 2);
    CHECK(reported[1].time_ns == 4 * second + 20'000);
    CHECK(reported[1].value == first_s + 2);
}

TEST_CASE("time_output: what is out of range, or taken, is ignored and said") {
    const std::function<void(wire::TimeOutput&)> faults[] = {
        [](auto& m) { m.index = 2; },
        [](auto& m) { m.output = 6; },
        [](auto& m) { m.board_ns += 20 * second; },
        [](auto& m) { m.utc_s = 0; },
        [](auto& m) { m.utc_s = 4'102'444'800; },
        [](auto& m) { m.pace_ppb = 600'000; },
        [](auto& m) { m.delay_ns = 200'000'000; },
        [](auto& m) { m.pulse_ns = 999'999; },
        [](auto& m) { m.pulse_ns = 500'000'001; },
        [](auto& m) { m.holdover_s = 0; },
        [](auto& m) { m.baud = 300; },
        [](auto& m) { m.sentences = 0; },
        [](auto& m) { m.sentences = 8; },
        [](auto& m) { m.sentence_delay_ms = 850; },
        [](auto& m) { m.talker[1] = '$'; },
    };
    for (const auto& fault : faults) {
        BoardBench bench;
        wire::TimeOutput message = message_of(2 * second);
        fault(message);
        bench.send(message);
        bench.run(second);
        CHECK(bench.port.uart.sent.empty());
        REQUIRE(bench.all<wire::Log>().size() == 1);
        CHECK(std::string(bench.all<wire::Log>()[0].text) ==
              "time_output is out of range or taken: ignored");
    }
    BoardBench bench;
    bench.configuration.ports.sync_rate_uhz = 1'000'000;
    bench.configure();
    wire::TimeOutput message = message_of(2 * second);
    message.output = wire::test_at_sync;
    bench.send(message);
    bench.run(1100 * ms);
    CHECK(bench.all<wire::Log>().size() == 1);
}

TEST_CASE("time_output: a message that says nothing of the time ends the pulses, at any moment") {
    const std::function<void(BoardBench&)> ends[] = {
        [](BoardBench& bench) {
            wire::TimeOutput unknown = message_of(0);
            unknown.flags = 0;
            bench.send(unknown);
        },
        [](BoardBench& bench) { bench.send(message_of(900 * second)); },  // out of range
        [](BoardBench& bench) {  // while the board waits for the last pulse of a configuration
            wire::TimeOutput unknown = message_of(0);
            unknown.flags = 0;
            bench.queue(bench.configuration);
            bench.queue(unknown);
            bench.run(bench.port.time);
        },
        [](BoardBench& bench) { bench.send(message_of(4 * second, first_s + 7)); },
    };
    for (const auto& end : ends) {
        BoardBench bench;
        bench.send(message_of(2 * second));
        bench.send(message_of(3 * second, first_s + 1));
        bench.run(3500 * ms);
        CHECK(changes(bench).size() == 6);
        bench.port.uart.sent.clear();
        end(bench);
        bench.run(5500 * ms);
        CHECK(changes(bench).size() == 6);
        CHECK(bench.port.uart.sent.find(",A,") == std::string::npos);
        CHECK(bench.port.uart.sent.find("$GPRMC,,V,") != std::string::npos);
    }
}

TEST_CASE("time_output: a configuration leaves it alone, or takes what it needs") {
    BoardBench bench;
    wire::TimeOutput message = message_of(2 * second);
    message.flags |= wire::time_pulse_inverted;
    bench.send(message);
    message.board_ns += second;
    ++message.utc_s;
    bench.send(message);
    bench.run(1500 * ms);
    const auto levels = [&] { return changes(bench).size(); };
    CHECK(levels() == 3);  // it rests high, but for a pulse
    bench.configure();
    bench.run(2500 * ms);
    CHECK(levels() == 5);
    bench.configuration.ports.test = wire::test_rate;
    bench.configuration.ports.test_rate_millihertz = 1000;
    bench.configure();
    bench.run(2600 * ms);
    bench.port.uart.sent.clear();
    bench.run(4500 * ms);
    CHECK(bench.port.uart.sent.empty());
    CHECK(bench.events(wire::BoardEventKind::time_pulse).size() == 2);
}

TEST_CASE("time_output: what it leaves is at rest: output and line") {
    BoardBench bench;
    wire::TimeOutput message = message_of(2 * second);
    message.flags |= wire::time_pulse_inverted | wire::time_serial_inverted;
    bench.send(message);
    bench.run(second);
    CHECK(bench.port.uart.inverted);
    CHECK(changes(bench) == std::vector<std::pair<Nanoseconds, bool>>{{1 * ms, true}});
    SECTION("it is not used any more") {
        message = {};
        bench.send(message);
        bench.run(3 * second);
    }
    SECTION("an IMU needs the line") {
        bench.configuration.imus[1] = {wire::ImuKind::vn100, 0, 0, 0, 200'000};
        bench.configure();
        bench.run(3 * second);
    }
    CHECK_FALSE(bench.port.uart.inverted);
    REQUIRE(changes(bench).size() == 2);
    CHECK_FALSE(changes(bench)[1].second);
    bench.port.uart.sent.clear();
    bench.run(5 * second);
    CHECK(bench.port.uart.sent.find("RMC") == std::string::npos);
    CHECK(bench.all<wire::Log>().empty());
}
