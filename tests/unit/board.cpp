// SPDX-License-Identifier: BSD-3-Clause
// What the board says to the host, and what it makes of each message.
#include "board.hpp"

#include <array>
#include <catch2/catch.hpp>

#include "adis_device.hpp"
#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::scenario;
using namespace versavis::firmware;

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

TEST_CASE("board: an announced exposure out of range is ignored and counted") {
    World world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.send(wire::ExpectedExposure{4, {}, 1, ms});
    world.send(wire::ExpectedExposure{0, {}, 1, -1});
    world.send(wire::ExpectedExposure{0, {}, 1, 0});
    world.run(2 * second);
    CHECK(world.inbox().healths.back().ignored == 2);
}

TEST_CASE("board: a light that ends as soon as the port can is not late") {
    World world(1, firmware::chip_model(2 * us, 1));
    world.add_camera(0);
    world.configuration.illumination = {1, 0, {}, 0, 10'000'000, 1'000'000};
    REQUIRE(world.begin());
    world.run(second);
    REQUIRE(world.lights().size() >= 19);
    CHECK(world.inbox().events_of(wire::EventKind::output_late).empty());
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

namespace {

constexpr std::uint32_t one_camera = wire::present_camera0;

/// Everything but the answers to a start is at its default: cameras at 20 Hz, on the same grid.
struct Cameras : Bench {
    explicit Cameras(unsigned count, std::uint32_t flags = 0) {
        for (unsigned i = 0; i < count; ++i) add_camera(i, flags);
    }
    /// A bit for each output that had a pulse since the last call.
    unsigned pulsed() {
        unsigned outputs = 0;
        for (unsigned i = 0; i < output_count; ++i) outputs |= pulses(i).empty() ? 0 : 1U << i;
        port.words.clear();
        return outputs;
    }
    void run_for(Nanoseconds duration) { run(port.time + duration); }
};

/// A VN-100 at the UART, and an ADIS16448 at the SPI.
void add_imus(Bench& bench, std::uint8_t options) {
    bench.configuration.imus[0] = {wire::ImuKind::adis16448b, 0, options, 0, 400'000};
    bench.configuration.imus[1] = {wire::ImuKind::vn100, 0, options, 0, 300'000};
}

std::vector<std::uint8_t> bytes_of(const wire::Configuration& configuration) {
    std::vector<std::uint8_t> bytes(sizeof configuration);
    std::memcpy(bytes.data(), &configuration, sizeof configuration);
    return bytes;
}

}  // namespace

TEST_CASE("board: its hello tells of the port, the firmware and this life") {
    BenchPort port;
    port.time = 7 * second;
    port.facts.present = wire::present_all & ~(one_camera << 1U);
    port.facts.fastest_imu_millihertz = 1'234;
    Bench bench(port, {0xABCD, wire::ResetCause::watchdog, "B7"});
    bench.greet();
    bench.configure();  // which takes what else waits along
    const auto hellos = bench.all<wire::BoardHello>();
    REQUIRE(hellos.size() == 1);
    const wire::BoardHello& hello = hellos[0];
    CHECK(hello.major == wire::protocol_major);
    CHECK(hello.minor == wire::protocol_minor);
    CHECK(hello.cameras == 3);
    CHECK(hello.reset_cause == wire::ResetCause::watchdog);
    CHECK(hello.capabilities == 0x3FF);
    CHECK(hello.board_time_ns == 7 * second);
    CHECK(hello.present == port.facts.present);
    CHECK(hello.fastest_imu_millihertz == 1'234);
    CHECK(std::string(hello.serial) == "B7");
    CHECK_THAT(std::string(hello.firmware, sizeof hello.firmware),
               Catch::StartsWith("versavis 0."));
    CHECK(bench.health().reset_cause == wire::ResetCause::watchdog);
}

TEST_CASE("board: before it is greeted, and to an unknown version, it only says who it is") {
    for (const bool other_version : {false, true}) {
        Bench bench{BenchPort()};
        bench.add_camera(0);
        if (other_version) bench.greet(wire::protocol_major + 1);
        const std::size_t greeted = bench.all<wire::BoardHello>().size();
        CHECK(greeted == (other_version ? 1 : 0));
        bench.send(bench.configuration);
        bench.send(wire::Start{1, 0, {}});
        bench.send(wire::Reboot{wire::reboot_magic, 0});
        bench.run(3 * second);
        bench.send(wire::ClockRequest{5, 0});
        bench.run(4 * second);
        CHECK(bench.port.words.empty());
        CHECK(bench.port.reboots.empty());
        CHECK(bench.all<wire::BoardHello>().size() == greeted + 1);
        wire::Decoder decoder;
        unsigned packets = 0;
        decoder.feed(bench.port.sent.data(), bench.port.sent.size(),
                     [&](const wire::Packet& /*packet*/) { ++packets; });
        CHECK(packets == greeted + 1);
        bench.greet();
        bench.send(wire::ClockRequest{6, 0});
        bench.run(4 * second + ms);
        CHECK(bench.all<wire::BoardHello>().size() == greeted + 2);
        const auto answers = bench.all<wire::ClockAnswer>();
        REQUIRE(answers.size() == 1);
        CHECK(answers[0].id == 6);
        CHECK(answers[0].reserved == 0);
        CHECK(answers[0].received_ns == 4 * second);
    }
}

TEST_CASE("board: it reboots when it is told so by the right word") {
    Bench bench;
    bench.send(wire::Reboot{wire::reboot_magic + 1, 0});
    bench.send(wire::Reboot{0, 1});
    CHECK(bench.port.reboots.empty());
    for (const std::uint32_t to_boot_loader : {0U, 1U, 2U})
        bench.send(wire::Reboot{wire::reboot_magic, to_boot_loader});
    CHECK(bench.port.reboots == std::vector<bool>{false, true, true});
}

TEST_CASE("board: one poll takes four packets, and what remains is due at once") {
    Bench bench;
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
    Bench bench{BenchPort()};
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

TEST_CASE("board: health comes once a second, and not twice after a pause") {
    Bench bench;
    bench.run(2'500 * ms);
    CHECK(bench.all<wire::Health>().size() == 2);
    bench.poll(5'700 * ms);
    bench.run(6'600 * ms);
    const auto healths = bench.all<wire::Health>();
    REQUIRE(healths.size() == 3);
    CHECK(healths[1].board_time_ns == 2 * second);
    CHECK(healths[2].board_time_ns == 5'700 * ms);
    bench.run(6'700 * ms);
    CHECK(bench.all<wire::Health>().size() == 4);
}

TEST_CASE("board: the longest delay is that of what was due, since the last health") {
    BenchPort port;
    port.time = 5 * second;  // before that nothing was due
    Bench bench(port);
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
    Bench bench;
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
    Bench bench;
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

TEST_CASE("board: an output that is late is told, counted, and moves the record of its trigger") {
    for (const std::uint32_t flags : {0U, std::uint32_t{wire::camera_trigger_inverted}}) {
        Cameras bench(4, wire::camera_no_strobe | flags);
        bench.configure();
        bench.port.late = 100 * us;  // the pulse begins when it should end
        bench.send(wire::Start{8, 0, {}});
        bench.run(60 * ms);
        const auto late = bench.events(wire::EventKind::output_late);
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
        CHECK(counted == bench.events(wire::EventKind::output_late).size());
    }
}

TEST_CASE("board: an output that leaves later by rounding is not late, and its record is exact") {
    BenchPort port;
    port.facts.output_step = 16;
    port.late = 1;
    Bench bench(port);
    bench.greet();
    bench.add_camera(0, wire::camera_no_strobe);
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(60 * ms);
    const auto records = bench.all<wire::Exposure>();
    REQUIRE(records.size() == 1);
    CHECK(records[0].trigger_ns == 48 * ms + 1);
    CHECK((records[0].flags & wire::exposure_late) == 0);
    CHECK(bench.events(wire::EventKind::output_late).empty());
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

TEST_CASE("board: an exposure that does not come is told as soon as all edges are known") {
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
    World world(1, model);
    world.add_imu(
        std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
        wire::ImuKind::adis16448b, 102.4, true);
    REQUIRE(world.begin());
    world.run(second);
    REQUIRE(world.inbox().samples[0].size() > 50);
    for (const wire::ImuSample& sample : world.inbox().samples[0])
        REQUIRE(sample.departure_ns < 2'000'000);
}

TEST_CASE("board: samples are served at the second port where the configuration says so") {
    for (const bool serves : {false, true}) {
        World world;
        world.add_imu(
            std::make_unique<devices::AdisDevice>(devices::AdisModel::adis16448b, &World::motion),
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
        return bench.events(wire::EventKind::illumination_limited).size();
    };
    CHECK(limited(0) == 0);
    CHECK(limited(800 * us) > 10);
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

TEST_CASE("board: stray edges are all counted, and told ten times a second") {
    Bench bench;
    bench.add_camera(0);
    bench.configure();
    for (Nanoseconds at = 10 * ms; at < 220 * ms; at += 20 * ms) {
        bench.edge(0, at, (at / ms) % 40 == 10);
        bench.poll(at + ms);
    }
    std::vector<Nanoseconds> told;
    const auto events = bench.events(wire::EventKind::stray_edge);
    for (const wire::Event& event : events) told.push_back(event.time_ns);
    CHECK(told == std::vector<Nanoseconds>{10 * ms, 110 * ms, 210 * ms});
    for (std::size_t i = 0; i < events.size(); ++i) CHECK(events[i].sequence == i);
    CHECK(bench.health().stray_edges == 11);
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
    Bench bench;
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
    Bench bench;
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

TEST_CASE("board: pulses at a rate of their own leave where they are told to") {
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
    const auto routed = [](const Bench& bench) {
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
    Bench bench;
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
        Bench bench;
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
    Bench bench;
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

TEST_CASE("board: a configuration that is refused changes nothing, and tells each reason") {
    Bench bench;
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
    Bench bench;
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
    CHECK(bytes_of(answer.taken) == bytes_of(taken));
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
    Bench bench;
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

TEST_CASE("board: pulses of the old configuration end before the new one is in force") {
    Bench bench;
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

TEST_CASE("board: a hello ends what the host before began, and leaves the configuration") {
    Cameras bench(2);
    bench.configuration.cameras[0].max_exposure_ns = second;
    bench.configuration.ports.sync_rate_uhz = 10'000'000;
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(48 * ms);
    bench.edge(0, 48 * ms);
    bench.run(49 * ms);
    bench.send(wire::Stop{1, {}});
    bench.send(bench.configuration);  // it waits for the exposure
    bench.run(60 * ms);
    bench.greet();
    CHECK(bench.all<wire::BoardHello>().size() == 2);
    bench.edge(0, 70 * ms, false);
    bench.pulsed();
    bench.run(550 * ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 1);
    CHECK(bench.pulses(output_sync).size() == 5);
    CHECK(bench.pulsed() == 1U << output_sync);
    // Cameras stop, and none waits for a sync pulse any more.
    bench.send(wire::Start{3, 0, {}});
    bench.run_for(100 * ms);
    CHECK(bench.pulsed() == (3U | 1U << output_sync));
    bench.greet();
    bench.run_for(100 * ms);
    bench.send(wire::Start{3, wire::start_on_sync, {}});
    bench.greet();
    bench.pulsed();
    for (int i = 0; i < 2; ++i) {
        bench.run_for(100 * ms);
        bench.edge(input_pulse + unsigned{wire::pulse_sync}, bench.port.time);
    }
    bench.run_for(100 * ms);
    CHECK(bench.pulsed() == 1U << output_sync);
}

TEST_CASE("board: what waited for the host before is not told to the next one") {
    Bench bench;
    bench.port.room = 0;
    for (std::uint32_t id = 0; id < 5; ++id) bench.send(wire::ClockRequest{id, 0});
    bench.greet();
    bench.port.room = 100'000;
    bench.run(ms);
    CHECK(bench.all<wire::ClockAnswer>().empty());
    CHECK(bench.all<wire::BoardHello>().size() == 2);
}

TEST_CASE("board: cameras that wait for a sync pulse wait no longer in a new configuration") {
    Cameras bench(1);
    bench.configure();
    bench.send(wire::Start{1, wire::start_on_sync, {}});
    bench.configure();
    for (const Nanoseconds at : {second, 2 * second}) {
        bench.run(at);
        bench.edge(input_pulse + unsigned{wire::pulse_sync}, at);
    }
    bench.run(3 * second);
    CHECK(bench.pulsed() == 0);
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

TEST_CASE("board: announced exposures move the triggers of their camera") {
    Cameras bench(4);
    bench.configure();
    bench.send(wire::ExpectedExposure{3, {}, 1, 10 * ms});
    bench.send(wire::ExpectedExposure{2, {}, 1, -1});
    bench.send(wire::ExpectedExposure{1, {}, 1, 0});
    bench.send(wire::ExpectedExposure{4, {}, 1, 10 * ms});  // there is none
    bench.send(wire::Start{15, 0, {}});
    bench.run(60 * ms);
    const Nanoseconds triggers[] = {48 * ms, 50 * ms, 48 * ms, 45 * ms};
    for (unsigned i = 0; i < 4; ++i)
        CHECK(bench.pulses(i) == std::vector<Nanoseconds>{triggers[i]});
}

TEST_CASE("board: a configuration that is to be kept is stored, and told when it is safe") {
    Bench bench;
    bench.configure();
    CHECK(bench.port.stored.empty());
    bench.configuration.flags = wire::configuration_store;
    for (const bool safe : {true, false}) {
        bench.configuration.id += 5;
        bench.port.outcome = Persist::Outcome::busy;
        bench.configure();
        CHECK(bench.port.stored == bytes_of(bench.configuration));
        bench.run(bench.port.time + 300 * ms);
        const std::size_t before = bench.events(wire::EventKind::stored).size();
        CHECK(before == (safe ? 0 : 1));
        bench.port.outcome = safe ? Persist::Outcome::stored : Persist::Outcome::failed;
        const Nanoseconds at = bench.port.time + ms;
        bench.poll(at);
        bench.run(at + second);
        const auto events = bench.events(wire::EventKind::stored);
        REQUIRE(events.size() == before + 1);
        CHECK(events.back().source == 0);
        CHECK(events.back().value == (safe ? 1 : 0));
        CHECK(events.back().time_ns == at);
    }
}

TEST_CASE("board: what was stored is in force from power-up, if it is whole and fits the board") {
    BenchPort port;
    port.time = 3 * second;
    wire::Configuration kept = Bench().configuration;
    kept.ports.sync_rate_uhz = 10'000'000;
    port.stored = bytes_of(kept);
    Bench bench(port);
    CHECK(bench.port.inputs == 0xF0U << 2U);
    bench.run(3 * second + 150 * ms);
    CHECK(bench.pulses(output_sync) == std::vector<Nanoseconds>{3 * second + 100 * ms});
    BenchPort cut = port;
    cut.stored.pop_back();
    CHECK(Bench(cut).port.inputs == 0);
    BenchPort longer = port;
    longer.stored.push_back(0);
    CHECK(Bench(longer).port.inputs == 0);
    BenchPort small = port;
    small.facts.present = 0;
    Bench lacking(small);
    CHECK(lacking.port.inputs == 0);
    lacking.greet();
    lacking.run(4 * second);
    CHECK(lacking.all<wire::Refusal>().empty());
    lacking.configuration = {};
    CHECK(lacking.configure().refused == 0);
}

TEST_CASE("board: light follows a camera without an exposure line by the plan, slaves too") {
    for (const std::uint8_t master : {0, 1}) {
        const auto slave = static_cast<std::uint8_t>(1 - master);
        const auto leads = [&](unsigned lit, bool with_slave) {
            Bench bench;
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

TEST_CASE("board: health counts what both IMUs did, and what the cameras skipped") {
    Bench bench;
    add_imus(bench, 0);
    bench.configuration.imus[0] = {};
    bench.configure();
    bench.run(20 * second);
    const std::uint32_t uart = bench.health().imu_restarts;
    for (const auto& event : bench.events(wire::EventKind::imu_silent)) CHECK(event.source == 1);
    CHECK(uart > 0);
    CHECK(uart < 100);
    bench.configuration.imus[1] = {};
    bench.configuration.imus[0] = {wire::ImuKind::adis16448b, 0, 0, 0, 400'000};
    bench.add_camera(0);
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(30 * second);
    bench.port.packets.push_back({1, 2, 3, 4, 5, 6, 7, 8, 0});
    bench.poll(31 * second);  // triggers were skipped
    const wire::Health health = bench.health();
    CHECK(health.imu_restarts > uart);
    CHECK(health.imu_restarts < 100);
    CHECK(health.receive_errors == 1);
    CHECK(health.sync_state == wire::SyncState::none);
    CHECK(health.skipped_triggers == 20);
    CHECK(bench.health().skipped_triggers == 20);
}

TEST_CASE("board: health tells what its inputs, its outputs and the link count") {
    Bench bench;
    bench.add_camera(0);
    bench.configuration.imus[0] = {wire::ImuKind::bmi088, 0, wire::imu_data_ready, 0, 400'000};
    bench.configure();
    bench.send(wire::Start{1, 0, {}});
    bench.run(30 * ms);
    bench.port.room = 0;
    for (std::uint32_t id = 0; id < 12; ++id) bench.send(wire::ClockRequest{id, 0});
    bench.port.room = 100'000;
    bench.run(200 * ms);
    for (Nanoseconds at = 300 * ms; at < 4 * second; at += second + 10 * us) {
        bench.run(at);
        bench.edge(input_pulse + unsigned{wire::pulse_pps}, at);
    }
    wire::Health health = bench.all<wire::Health>().front();
    CHECK(health.dropped_clock_answers >= 3);
    CHECK(health.dropped_clock_answers <= 4);
    CHECK(health.link_queue_max >= 8);
    CHECK(health.output_queue_max >= 2);
    CHECK(health.glitches == 0);
    health = bench.health();
    CHECK(health.pps_state == wire::PpsState::good);
    CHECK(std::abs(health.pps_error_ppb - 10'000) < 10);
    // Of an exposure line, and of a data-ready line.
    for (const std::uint8_t input : {std::uint8_t{0}, std::uint8_t{input_imu_ready}}) {
        const std::uint32_t before = bench.health().glitches;
        const Nanoseconds at = bench.port.time + 12 * ms;
        bench.edge(input, at);
        bench.edge(input, at + us, input != 0);
        bench.run(at + ms);
        CHECK(bench.health().glitches - before >= 1);
        CHECK(bench.health().glitches - before <= 2);
    }
}

TEST_CASE("board: an input that was ignored is listened to again a second later") {
    Bench bench;
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
