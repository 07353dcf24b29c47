// SPDX-License-Identifier: BSD-3-Clause
// What the board says to the host, and what it makes of each message.
#include "board.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <functional>

#include "board_bench.hpp"
#include "world.hpp"

using namespace versavis;
using namespace versavis::test;
using namespace versavis::firmware;

namespace {

constexpr std::uint32_t one_camera = wire::present_camera0;

}  // namespace

TEST_CASE("board: it says who it is, and what it can do") {
    scenario::World world;
    world.connect();
    REQUIRE(world.inbox().hellos.size() == 1);
    const wire::BoardHello& hello = world.inbox().hellos[0];
    CHECK(hello.major == wire::protocol_major);
    CHECK(hello.cameras == 4);
    CHECK(std::string(hello.serial) == "TEST");
    CHECK((hello.capabilities & wire::capability_slaves) != 0);
    CHECK(hello.reset_cause == wire::ResetCause::power_on);
}

TEST_CASE("board: a host of another major version learns who is there, and nothing more") {
    scenario::World world;
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
    scenario::World world;
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
    scenario::World world;
    world.connect();
    world.run(10 * second);
    CHECK(world.inbox().healths.size() == 10);
    CHECK(world.inbox().lost == 0);
}

TEST_CASE(
    "board: when a clock answer left is reported after it, also when the host was slow to take "
    "it") {
    scenario::World world;
    world.connect();
    for (const Nanoseconds stall : {Nanoseconds{0}, 300 * ms}) {
        world.inbox() = {};
        world.stall_host(stall);
        world.send(wire::ClockRequest{77, 0});
        const Nanoseconds asked = world.now();
        world.run(stall + 10 * ms);
        REQUIRE(world.inbox().clock_answers.size() == 1);
        REQUIRE(world.inbox().follow_ups.size() == 1);
        const wire::ClockFollowUp& follow_up = world.inbox().follow_ups[0];
        CHECK(follow_up.id == 77);
        CHECK(world.inbox().clock_answers[0].sent_ns - asked < ms);
        CHECK(follow_up.sent_ns >= asked + stall);
        CHECK(follow_up.sent_ns <= asked + stall + ms);
    }
}

TEST_CASE("board: an announced exposure out of range is ignored and counted") {
    scenario::World world;
    world.add_camera(0);
    REQUIRE(world.begin());
    world.send(wire::ExpectedExposure{4, {}, 1, ms});
    world.send(wire::ExpectedExposure{0, {}, 1, -1});
    world.send(wire::ExpectedExposure{0, {}, 1, 0});
    world.run(2 * second);
    CHECK(world.inbox().healths.back().ignored == 2);
}

TEST_CASE("board: its hello names the port, the firmware and this life") {
    BenchPort port;
    port.time = 7 * second;
    port.facts.present = wire::present_all & ~(one_camera << 1U);
    port.facts.fastest_imu_millihertz = 1'234;
    BoardBench bench(port, {0xABCD, wire::ResetCause::watchdog, "B7"});
    bench.greet();
    bench.configure();  // which takes what else waits along
    const auto hellos = bench.all<wire::BoardHello>();
    REQUIRE(hellos.size() == 1);
    const wire::BoardHello& hello = hellos[0];
    CHECK(hello.major == wire::protocol_major);
    CHECK(hello.minor == wire::protocol_minor);
    CHECK(hello.cameras == 3);
    CHECK(hello.reset_cause == wire::ResetCause::watchdog);
    CHECK(hello.capabilities == 0x3FFF);
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
        BoardBench bench{BenchPort()};
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

TEST_CASE("board: it reboots on the right word") {
    BoardBench bench;
    bench.send(wire::Reboot{wire::reboot_magic + 1, 0});
    bench.send(wire::Reboot{0, 1});
    CHECK(bench.port.reboots.empty());
    for (const std::uint32_t to_boot_loader : {0U, 1U, 2U})
        bench.send(wire::Reboot{wire::reboot_magic, to_boot_loader});
    CHECK(bench.port.reboots == std::vector<bool>{false, true, true});
}

TEST_CASE("board: health comes once a second, and not twice after a pause") {
    BoardBench bench;
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

TEST_CASE("board: what waited for the host before is not sent to the next one") {
    BoardBench bench;
    bench.port.room = 0;
    for (std::uint32_t id = 0; id < 5; ++id) bench.send(wire::ClockRequest{id, 0});
    bench.greet();
    bench.port.room = 100'000;
    bench.run(ms);
    CHECK(bench.all<wire::ClockAnswer>().empty());
    CHECK(bench.all<wire::BoardHello>().size() == 2);
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

TEST_CASE("board: health counts what both IMUs did, and what the cameras skipped") {
    BoardBench bench;
    add_imus(bench, 0);
    bench.configuration.imus[0] = {};
    bench.configure();
    bench.run(20 * second);
    const std::uint32_t uart = bench.health().imu_restarts;
    for (const auto& event : bench.events(wire::BoardEventKind::imu_silent))
        CHECK(event.source == 1);
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
    CHECK(health.stamp_test == wire::StampTest::none);
    bench.port.test = wire::StampTest::failed;
    CHECK(bench.health().stamp_test == wire::StampTest::failed);
    CHECK(health.skipped_triggers == 20);
    CHECK(bench.health().skipped_triggers == 20);
}

TEST_CASE("board: health reports what its inputs, its outputs and the link count") {
    BoardBench bench;
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

namespace {

/// Cameras 0 and 1 run; the second of them stops, and the configuration is to change it. If it has
/// an exposure line, it exposes.
struct ChangingCamera : Cameras {
    explicit ChangingCamera(std::uint32_t flags = wire::camera_no_strobe) : Cameras(2, flags) {
        configuration.ports.sync_rate_uhz = 10'000'000;
        configuration.cameras[1].max_exposure_ns = 150 * ms;
        add_imus(*this, 0);
        configure();
        send(wire::Start{3, 0, {}});
        run(998 * ms);
        if (flags == 0) edge(1, 998 * ms);
        run(1'010 * ms);
        send(wire::Stop{2, {}});
        configuration.flags = wire::configuration_cameras;
    }
    wire::ConfigurationAnswer change() {
        const std::size_t before = all<wire::ConfigurationAnswer>().size();
        ++configuration.id;
        send(configuration);
        run_for(250 * ms);
        const auto answers = all<wire::ConfigurationAnswer>();
        REQUIRE(answers.size() == before + 1);
        CHECK(answers.back().id == configuration.id);
        return answers.back();
    }
    /// Ticks of its records with a trigger from `begin` on.
    std::vector<std::uint64_t> ticks(unsigned camera, Nanoseconds begin) const {
        std::vector<std::uint64_t> found;
        for (const auto& record : all<wire::Exposure>())
            if (record.camera == camera && record.trigger_ns >= begin) found.push_back(record.tick);
        return found;
    }
};

}  // namespace

TEST_CASE("board: a stopped camera changes while others run, and nothing else is touched") {
    ChangingCamera bench;
    wire::CameraConfiguration& camera = bench.configuration.cameras[1];
    camera.rate_uhz = 40'000'000;
    camera.exposure_ns = 2 * ms;
    const unsigned disarmed = bench.port.disarmed;
    bench.send(bench.configuration);
    bench.run_for(60 * ms);
    CHECK(bench.port.disarmed == disarmed);  // no IMU is set up
    const wire::ConfigurationAnswer answer = bench.all<wire::ConfigurationAnswer>().back();
    CHECK(answer.status == wire::ConfigurationStatus::taken);
    CHECK(answer.taken.cameras[1].rate_uhz == 40'000'000);
    CHECK(answer.taken.cameras[0].rate_uhz == 20'000'000);
    CHECK(answer.origin_ns == 0);
    const Nanoseconds begin = bench.port.time;
    bench.send(wire::Start{2, 0, {}});
    bench.run(begin + second);
    bench.send(wire::Stop{3, {}});
    bench.run_for(100 * ms);
    // Points of the same grid at its own rate; the middles of both lie on them.
    const auto ticks = bench.ticks(1, begin);
    REQUIRE(ticks.size() >= 38);
    const auto records = bench.all<wire::Exposure>();
    for (const auto& record : records)
        if (record.camera == 1 && record.trigger_ns >= begin)
            CHECK(record.trigger_ns == static_cast<Nanoseconds>(record.tick) * 25 * ms - ms);
    // The other camera and the sync output had no pause.
    const auto others = bench.ticks(0, 0);
    for (std::size_t i = 1; i < others.size(); ++i) CHECK(others[i] == others[i - 1] + 1);
    const auto pulses = bench.pulses(output_sync);
    for (std::size_t i = 1; i < pulses.size(); ++i) CHECK(pulses[i] - pulses[i - 1] == 100 * ms);
    CHECK(pulses.size() >= 20);
}

TEST_CASE("board: a camera that changes at the same rate uses no tick twice") {
    ChangingCamera bench;
    bench.configuration.cameras[1].phase_ns = 49'000'000;
    const std::uint64_t before = bench.ticks(1, 0).back();
    bench.send(bench.configuration);
    const Nanoseconds begin = bench.port.time;
    bench.send(wire::Start{2, 0, {}});
    bench.run(begin + second);
    const auto ticks = bench.ticks(1, begin);
    REQUIRE(ticks.size() > 10);
    CHECK(ticks.front() > before);
}

TEST_CASE("board: a change of a camera waits for its exposure that is under way") {
    ChangingCamera bench(0);
    bench.configuration.cameras[1].exposure_ns = 2 * ms;
    bench.send(bench.configuration);
    bench.run_for(30 * ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 1);
    // The other cameras may be stopped and started meanwhile, this one not.
    bench.send(wire::Stop{1, {}});
    bench.send(wire::Start{3, 0, {}});
    bench.edge(1, bench.port.time, false);
    bench.run_for(ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 2);
    // What was recorded before comes before the answer.
    std::vector<wire::Type> order;
    wire::Decoder decoder;
    decoder.feed(bench.port.sent.data(), bench.port.sent.size(),
                 [&](const wire::Packet& packet) { order.push_back(packet.header.type); });
    const auto last = [&](wire::Type type) {
        return std::find(order.rbegin(), order.rend(), type) - order.rbegin();
    };
    CHECK(bench.all<wire::Exposure>().back().camera == 1);
    CHECK(last(wire::Type::exposure) > last(wire::Type::configuration_answer));
    bench.pulsed();
    bench.run_for(100 * ms);
    CHECK(bench.pulsed() == (1U | 1U << output_sync));
}

TEST_CASE("board: a camera that changes keeps its pause after the exposure before") {
    ChangingCamera bench(0);
    bench.configuration.cameras[1].gap_ns = 40'000'000;
    bench.configuration.cameras[1].exposure_ns = ms;
    bench.edge(1, bench.port.time + 9 * ms, false);
    bench.run_for(10 * ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 1);
    bench.send(bench.configuration);
    bench.run_for(ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 2);
    bench.pulsed();
    bench.send(wire::Start{2, 0, {}});
    const Nanoseconds ended = 1'019 * ms;
    bench.run(1'200 * ms);
    REQUIRE_FALSE(bench.pulses(1).empty());
    CHECK(bench.pulses(1).front() >= ended + 40 * ms);
}

TEST_CASE("board: what is not a change of stopped cameras alone needs all to stop") {
    const auto refused = [](const std::function<void(ChangingCamera&)>& alter) {
        ChangingCamera bench;
        bench.configuration.cameras[1].exposure_ns = 2 * ms;
        alter(bench);
        const wire::ConfigurationAnswer answer = bench.change();
        CHECK(answer.taken.cameras[1].exposure_ns == 4 * ms);
        return answer.status == wire::ConfigurationStatus::running;
    };
    CHECK_FALSE([&] {
        ChangingCamera bench;
        bench.configuration.cameras[1].exposure_ns = 2 * ms;
        return bench.change().status == wire::ConfigurationStatus::running;
    }());
    CHECK(refused([](auto& bench) { bench.send(wire::Start{2, 0, {}}); }));
    CHECK(refused([](auto& bench) { bench.configuration.cameras[0].exposure_ns = 2 * ms; }));
    CHECK(refused([](auto& bench) {
        bench.configuration.cameras[1].flags |= wire::camera_trigger_inverted;
    }));
    CHECK(refused([](auto& bench) { bench.configuration.cameras[1].flags = 0; }));
    CHECK(refused([](auto& bench) { bench.add_camera(2); }));
    CHECK(refused([](auto& bench) { bench.configuration.imus[0].rate_millihertz = 200'000; }));
    CHECK(refused([](auto& bench) { bench.configuration.illumination.max_on_ns = 20'000; }));
    CHECK(refused([](auto& bench) { bench.configuration.ports.test = wire::test_camera0; }));
    CHECK(refused([](auto& bench) { bench.configuration.flags |= wire::configuration_store; }));
    CHECK(refused([](auto& bench) { bench.configuration.cameras[1].exposure_ns = 4 * ms; }));
    // A camera that slaves follow.
    ChangingCamera bench(0);
    bench.send(wire::Stop{3, {}});
    bench.run_for(250 * ms);
    bench.configuration.flags = 0;
    bench.add_slave(2, 1);
    bench.configure();
    bench.configuration.flags = wire::configuration_cameras;
    bench.configuration.cameras[1].exposure_ns = 2 * ms;
    CHECK(bench.change().status == wire::ConfigurationStatus::running);
}

TEST_CASE("board: a change of a camera out of range is refused") {
    ChangingCamera bench;
    bench.configuration.cameras[1].rate_uhz = 1;
    CHECK(bench.change().status == wire::ConfigurationStatus::refused);
    bench.configuration.imus[0] = {wire::ImuKind::adis16448b, 0, wire::imu_data_ready, 0, 0};
    CHECK(bench.change().status == wire::ConfigurationStatus::refused);
}

TEST_CASE("board: a hello drops a change of a camera that waits, and pulses go on") {
    ChangingCamera bench(0);
    bench.configuration.cameras[1].rate_uhz = 40'000'000;
    bench.send(bench.configuration);
    bench.greet();
    bench.run_for(500 * ms);
    CHECK(bench.all<wire::ConfigurationAnswer>().size() == 1);
    const auto pulses = bench.pulses(output_sync);
    for (std::size_t i = 1; i < pulses.size(); ++i) CHECK(pulses[i] - pulses[i - 1] == 100 * ms);
}
