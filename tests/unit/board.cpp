// SPDX-License-Identifier: BSD-3-Clause
// The firmware's core in its native port, in virtual time, against a camera model.
#include "board.hpp"

#include <catch2/catch.hpp>
#include <functional>
#include <map>
#include <optional>

#include "native_board.hpp"

using namespace versavis;
using namespace versavis::firmware;

namespace {

constexpr Nanoseconds ms = 1'000'000;
constexpr Nanoseconds second = 1'000'000'000;
constexpr Nanoseconds latency = 20'000;

/// A board with a camera on output 0 whose exposure is a function of the pulse's number, and a host.
class Bench {
 public:
    explicit Bench(std::function<Nanoseconds(std::uint64_t)> exposure) : exposure_(std::move(exposure)) {
        Surroundings surroundings;
        surroundings.outputs_changed = [this](Nanoseconds at, std::uint32_t levels) { outputs(at, levels); };
        surroundings.imu_burst = [](Nanoseconds, auto, auto received) {
            std::fill(received.begin(), received.end(), 0);
        };
        surroundings.reboot = [this](bool to_boot_loader) { rebooted = to_boot_loader ? 2 : 1; };
        board_.emplace(Identity{0xB0A2D, wire::ResetCause::power_on, "TEST"}, std::move(surroundings));
    }

    template <class T>
    void send(const T& message) {
        wire::Frame frame{};
        wire::encode(message, 0x4057, sequence_++, frame);
        board_->receive({frame.bytes, frame.size}, now_);
        run(0);
    }

    void run(Nanoseconds duration) {
        now_ += duration;
        board_->run_until(now_);
        if (!reading) return;
        const auto bytes = board_->transmitted();
        decoder_.feed(bytes.data(), bytes.size(), [this](const wire::Packet& packet) { take(packet); });
        board_->consume(bytes.size());
    }

    wire::Configuration configuration(std::uint32_t rate_uhz) const {
        wire::Configuration c{};
        c.id = 1;
        c.cameras[0] = {wire::camera_enabled,
                        rate_uhz,
                        0,
                        100'000,
                        static_cast<std::uint32_t>(latency),
                        0,
                        3 * ms,
                        40 * ms};
        return c;
    }

    void begin(std::uint32_t rate_uhz, std::uint8_t flags = 0) {
        send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
        send(configuration(rate_uhz));
        REQUIRE(answer.status == wire::ConfigurationStatus::taken);
        send(wire::Start{1, flags, {}});
    }

    bool reading = true;
    std::vector<wire::Exposure> exposures;
    std::vector<wire::Event> events;
    std::vector<wire::ImuSample> samples;
    std::vector<wire::Health> healths;
    std::vector<std::uint32_t> sequences;
    std::vector<Nanoseconds> rises;
    wire::BoardHello hello{};
    wire::ConfigurationAnswer answer{};
    wire::ClockAnswer clock{};
    std::size_t packets = 0;
    int rebooted = 0;

 private:
    void outputs(Nanoseconds at, std::uint32_t levels) {
        const bool rise = (levels & 1U) != 0 && (levels_ & 1U) == 0;
        levels_ = levels;
        if (!rise) return;
        rises.push_back(at);
        const Nanoseconds exposure = exposure_(rises.size());
        if (exposure <= 0) return;
        board_->schedule_edge({at + latency, 0, true});
        board_->schedule_edge({at + latency + exposure, 0, false});
    }

    void take(const wire::Packet& packet) {
        ++packets;
        sequences.push_back(packet.header.sequence);
        wire::Exposure exposure{};
        wire::Event event{};
        wire::ImuSample sample{};
        wire::Health health{};
        if (packet.read(exposure)) exposures.push_back(exposure);
        if (packet.read(event)) events.push_back(event);
        if (packet.read(sample)) samples.push_back(sample);
        if (packet.read(health)) healths.push_back(health);
        packet.read(hello);
        packet.read(answer);
        packet.read(clock);
    }

    std::function<Nanoseconds(std::uint64_t)> exposure_;
    std::optional<NativeBoard> board_;
    wire::Decoder decoder_;
    Nanoseconds now_ = 0;
    std::uint32_t levels_ = 0;
    std::uint32_t sequence_ = 0;
};

Nanoseconds middle_of(const wire::Exposure& e) { return e.start_ns + (e.end_ns - e.start_ns) / 2; }

}  // namespace

TEST_CASE("board: silent until hello, then answers with who it is") {
    Bench bench([](auto) { return 3 * ms; });
    bench.send(bench.configuration(20'000'000));
    bench.send(wire::ClockRequest{1, 0});
    bench.run(3 * second);
    CHECK(bench.packets == 0);
    bench.send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
    CHECK(bench.hello.cameras == 4);
    CHECK(std::string(bench.hello.serial) == "TEST");
    bench.send(wire::ClockRequest{77, 0});
    CHECK(bench.clock.id == 77);
    CHECK(bench.clock.received_ns == 3 * second);
    bench.run(2 * second);
    CHECK(bench.healths.size() == 2);
}

TEST_CASE("board: the middles of constant exposures lie on the grid, at any rate, from the second one on") {
    const std::uint32_t rate_uhz = GENERATE(100'000U, 7'000'000U, 20'000'000U, 29'970'000U, 200'000'000U);
    Bench bench([](auto) { return 2 * ms; });
    bench.begin(rate_uhz);
    bench.run(second + 200'000'000'000'000 / (rate_uhz / 1000) / 1000 * 1000);
    REQUIRE(bench.exposures.size() > 100);
    const auto& first = bench.exposures[3];
    for (std::size_t i = 3; i < bench.exposures.size(); ++i) {
        const auto& e = bench.exposures[i];
        REQUIRE(e.flags == wire::exposure_measured);
        REQUIRE(e.trigger == i + 1);
        const auto ideal = static_cast<__int128>(e.tick - first.tick) * 1'000'000'000'000'000 / rate_uhz;
        REQUIRE(std::abs(middle_of(e) - middle_of(first) - static_cast<Nanoseconds>(ideal)) <= 1);
    }
}

TEST_CASE("board: the grid never shifts, whatever the exposure does; one that was announced is met exactly") {
    // Steps up, halves, vanishes for a while, and comes back.
    Bench bench([](std::uint64_t pulse) -> Nanoseconds {
        if (pulse < 20) return 4 * ms;
        if (pulse < 40) return 16 * ms;
        if (pulse < 60) return 3 * ms;
        if (pulse < 65) return 0;
        return 10 * ms;
    });
    bench.begin(20'000'000);
    bench.send(wire::ExpectedExposure{0, {}, 20, 16 * ms});
    bench.run(6 * second);
    std::map<std::uint64_t, wire::Exposure> by_trigger;
    for (const auto& e : bench.exposures) by_trigger[e.trigger] = e;
    const auto error = [&](std::uint64_t trigger) {
        const auto& e = by_trigger.at(trigger);
        const auto& first = by_trigger.at(5);
        return std::abs(middle_of(e) - middle_of(first) -
                        static_cast<Nanoseconds>(e.tick - first.tick) * 50 * ms);
    };
    CHECK(error(19) == 0);
    CHECK((by_trigger.at(20).flags & wire::exposure_announced) != 0);
    CHECK(error(20) == 0);
    CHECK(error(21) == 0);
    CHECK(error(40) == 13 * ms / 2);  // half the change that nobody announced
    CHECK(error(41) == 0);
    CHECK((by_trigger.at(62).flags & wire::exposure_no_start) != 0);
    CHECK(by_trigger.at(62).start_ns == wire::no_time);
    CHECK(error(65) == 7 * ms / 2);
    CHECK(error(66) == 0);
}

TEST_CASE("board: a trigger that a busy camera could not take is skipped and reported") {
    Bench bench([](std::uint64_t pulse) { return pulse == 10 ? 70 * ms : 5 * ms; });
    bench.send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
    auto configuration = bench.configuration(20'000'000);
    configuration.cameras[0].max_exposure_ns = 100 * ms;
    bench.send(configuration);
    bench.send(wire::Start{1, 0, {}});
    bench.run(2 * second);
    REQUIRE(bench.events.size() >= 1);
    CHECK(bench.events[0].kind == wire::EventKind::trigger_skipped);
    CHECK(bench.events[0].value == static_cast<std::int64_t>(bench.exposures[9].tick) + 1);
    for (std::size_t i = 0; i < bench.exposures.size(); ++i) {
        REQUIRE(bench.exposures[i].trigger == i + 1);
        REQUIRE((bench.exposures[i].flags & wire::exposure_measured) != 0);
    }
    CHECK(bench.exposures[9].end_ns - bench.exposures[9].start_ns == 70 * ms);
}

TEST_CASE("board: the start pattern leaves the gaps of the protocol") {
    Bench bench([](auto) { return 2 * ms; });
    bench.begin(20'000'000, wire::start_pattern);
    bench.run(2 * second);
    std::vector<std::uint64_t> gaps;
    for (std::size_t i = 1; i < 15; ++i)
        gaps.push_back(bench.exposures[i].tick - bench.exposures[i - 1].tick);
    CHECK(gaps == std::vector<std::uint64_t>{1, 2, 1, 3, 2, 2, 3, 3, 1, 1, 1, 1, 1, 1});
    CHECK((bench.exposures[0].flags & wire::exposure_pattern) != 0);
    CHECK((bench.exposures[14].flags & wire::exposure_pattern) == 0);
}

TEST_CASE("board: a configuration is taken whole or not at all, with the field and its range") {
    Bench bench([](auto) { return 2 * ms; });
    bench.begin(20'000'000);
    auto other = bench.configuration(30'000'000);
    other.id = 2;
    bench.send(other);
    CHECK(bench.answer.status == wire::ConfigurationStatus::running);
    bench.send(wire::Stop{1, {}});
    other.cameras[2] = other.cameras[0];
    other.cameras[2].rate_uhz = 99'999;
    bench.send(other);
    CHECK(bench.answer.id == 2);
    CHECK(bench.answer.status == wire::ConfigurationStatus::out_of_range);
    CHECK(bench.answer.field == wire::ConfigurationField::rate);
    CHECK(bench.answer.camera == 2);
    CHECK(bench.answer.minimum == 100'000);
    CHECK(bench.answer.taken.cameras[0].rate_uhz == 20'000'000);
    other.cameras[2].rate_uhz = 1'000'000'000;
    other.cameras[2].pulse_ns = 500'001;
    bench.send(other);
    CHECK(bench.answer.field == wire::ConfigurationField::pulse);
}

TEST_CASE("board: rates change at run time, without another image") {
    Bench bench([](auto) { return 2 * ms; });
    bench.begin(20'000'000);
    bench.run(second);
    bench.send(wire::Stop{1, {}});
    bench.run(second);
    const std::size_t before = bench.exposures.size();
    bench.send(bench.configuration(100'000'000));
    bench.send(wire::Start{1, 0, {}});
    bench.run(second);
    CHECK(before == Approx(20).margin(1));
    CHECK(bench.exposures.size() - before == Approx(100).margin(2));
}

TEST_CASE("board: the IMU is read on its grid; its checks are reported") {
    Bench bench([](auto) { return 0; });
    bench.send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
    wire::Configuration configuration{};
    configuration.imu = {wire::ImuKind::adis16448b, {}, 200'000'000};
    bench.send(configuration);
    bench.run(2 * second);
    REQUIRE(bench.samples.size() >= 398);
    for (std::size_t i = 1; i < bench.samples.size(); ++i) {
        REQUIRE(bench.samples[i].number == i);
        REQUIRE(bench.samples[i].time_ns - bench.samples[i - 1].time_ns == 5 * ms);
    }
    // The bench answers with zeros: no valid CRC.
    CHECK((bench.samples[0].flags & wire::imu_checksum_failed) != 0);
}

TEST_CASE("board: a host that does not read costs packets, which are counted, never the triggers") {
    Bench bench([](auto) { return 1 * ms; });
    bench.begin(500'000'000);
    bench.reading = false;
    bench.run(10 * second);
    CHECK(bench.rises.size() > 4900);
    bench.reading = true;
    bench.run(0);
    bench.run(2 * second);
    REQUIRE_FALSE(bench.healths.empty());
    const std::uint32_t dropped = bench.healths.back().dropped_packets;
    CHECK(dropped > 0);
    CHECK(bench.sequences.back() + 1 == bench.packets + dropped);
}

TEST_CASE("board: it reboots when told with the right word only") {
    Bench bench([](auto) { return 1 * ms; });
    bench.begin(20'000'000);
    bench.send(wire::Reboot{1, 0});
    CHECK(bench.rebooted == 0);
    bench.send(wire::Reboot{wire::reboot_magic, 1});
    CHECK(bench.rebooted == 2);
}
