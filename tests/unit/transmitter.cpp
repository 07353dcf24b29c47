// SPDX-License-Identifier: BSD-3-Clause
#include "transmitter.hpp"

#include <catch2/catch.hpp>
#include <utility>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

namespace {

struct Link final : ByteLink {
    std::size_t space = 0;
    std::vector<std::uint8_t> bytes;
    std::size_t watched = 0;  ///< bytes that were written when it was asked
    Nanoseconds left = 0;     ///< 0: it does not tell
    std::size_t free_space() override { return space; }
    void write(const std::uint8_t* data, std::size_t size) override {
        bytes.insert(bytes.end(), data, data + size);
        space -= size;
    }
    std::size_t read(std::uint8_t* /*data*/, Nanoseconds& /*received*/) override { return 0; }
    void watch_departure() override { watched = bytes.size(); }
    bool take_departure(Nanoseconds& at) override {
        at = std::exchange(left, 0);
        return at != 0;
    }
};

struct Clock final : Clock64 {
    Nanoseconds time = 0;
    Nanoseconds now() override { return time; }
};

struct Bench {
    Link link;
    Clock clock;
    Transmitter transmitter{link, clock, 7};

    /// What the host has received by now.
    std::vector<wire::Header> headers() {
        std::vector<wire::Header> out;
        wire::Decoder decoder;
        decoder.feed(link.bytes.data(), link.bytes.size(),
                     [&](const wire::Packet& packet) { out.push_back(packet.header); });
        return out;
    }

    template <class T>
    std::vector<T> received() {
        std::vector<T> out;
        wire::Decoder decoder;
        decoder.feed(link.bytes.data(), link.bytes.size(), [&](const wire::Packet& packet) {
            T message{};
            if (packet.read(message)) out.push_back(message);
        });
        return out;
    }
};

wire::Exposure exposure(std::uint64_t trigger) {
    wire::Exposure record{};
    record.trigger = trigger;
    return record;
}

}  // namespace

TEST_CASE(
    "transmitter: what matters most leaves first, numbered as it leaves, in pieces as small as the "
    "link "
    "takes") {
    Bench bench;
    bench.transmitter.send(wire::Log{wire::LogLevel::info, "text"});
    bench.transmitter.send(wire::ImuSample{});
    bench.transmitter.send(exposure(1));
    bench.transmitter.send(wire::ClockAnswer{1, 0, 0, 0});
    do {
        bench.link.space = 7;
        bench.clock.time += 1000;
        CHECK_FALSE(bench.transmitter.pump());
    } while (bench.link.space == 0);
    const auto headers = bench.headers();
    REQUIRE(headers.size() == 4);
    const wire::Type order[] = {wire::Type::clock_answer, wire::Type::exposure,
                                wire::Type::imu_sample, wire::Type::log};
    for (std::uint32_t i = 0; i < 4; ++i) {
        CHECK(headers[i].type == order[i]);
        CHECK(headers[i].sequence == i);
    }
}

TEST_CASE("transmitter: of a class that is full the newest stay, and the others are counted") {
    Bench bench;
    for (std::uint64_t trigger = 1; trigger <= 300; ++trigger)
        bench.transmitter.send(exposure(trigger));
    bench.link.space = 1'000'000;
    while (bench.transmitter.pump()) continue;
    std::vector<std::uint64_t> triggers;
    wire::Decoder decoder;
    decoder.feed(bench.link.bytes.data(), bench.link.bytes.size(), [&](const wire::Packet& packet) {
        wire::Exposure record{};
        if (packet.read(record)) triggers.push_back(record.trigger);
    });
    REQUIRE(triggers.size() == 256);
    CHECK(triggers.front() == 45);
    CHECK(triggers.back() == 300);
    wire::Health health{};
    bench.transmitter.count_drops(health);
    CHECK(health.dropped_exposures == 44);
    CHECK(health.dropped_imu_samples == 0);
}

TEST_CASE(
    "transmitter: a new connection hears nothing of the one before, not even the rest of a "
    "packet") {
    Bench bench;
    bench.transmitter.send(exposure(1));
    bench.transmitter.send(exposure(2));
    bench.link.space = 20;
    bench.transmitter.pump();
    bench.transmitter.begin();
    bench.transmitter.send(wire::BoardHello{});
    bench.link.space = 1'000;
    bench.transmitter.pump();
    const auto headers = bench.headers();
    REQUIRE(headers.size() == 1);
    CHECK(headers[0].type == wire::Type::board_hello);
}

TEST_CASE("transmitter: the time of sending is that at which the answer leaves") {
    Bench bench;
    bench.transmitter.send(wire::ClockAnswer{1, 0, 500, 0});
    bench.transmitter.pump();
    bench.clock.time = 90'000;
    bench.link.space = 1'000;
    bench.transmitter.pump();
    wire::ClockAnswer answer{};
    wire::Decoder decoder;
    decoder.feed(bench.link.bytes.data(), bench.link.bytes.size(),
                 [&](const wire::Packet& packet) { packet.read(answer); });
    CHECK(answer.received_ns == 500);
    CHECK(answer.sent_ns == 90'000);
}

TEST_CASE(
    "transmitter: when an answer left follows as soon as the link tells, before all that waits") {
    Bench bench;
    bench.transmitter.send(wire::ClockAnswer{42, 0, 500, 0});
    bench.link.space = 20;  // less than the answer
    bench.transmitter.pump();
    CHECK(bench.link.watched == 0);
    bench.link.space = 1'000;
    bench.transmitter.pump();
    REQUIRE(bench.received<wire::ClockAnswer>().size() == 1);
    CHECK(bench.link.watched == bench.link.bytes.size());
    CHECK(bench.received<wire::ClockFollowUp>().empty());
    bench.transmitter.send(exposure(1));
    bench.transmitter.send(wire::ClockAnswer{43, 0, 600, 0});
    bench.link.left = 12'345;
    bench.transmitter.pump();
    const auto headers = bench.headers();
    REQUIRE(headers.size() == 4);
    CHECK(headers[1].type == wire::Type::clock_follow_up);
    REQUIRE(bench.received<wire::ClockFollowUp>().size() == 1);
    CHECK(bench.received<wire::ClockFollowUp>()[0].id == 42);
    CHECK(bench.received<wire::ClockFollowUp>()[0].sent_ns == 12'345);
}

TEST_CASE("transmitter: a new connection hears nothing of the departures of the one before") {
    Bench bench;
    bench.transmitter.send(wire::ClockAnswer{42, 0, 500, 0});
    bench.link.space = 1'000;
    bench.transmitter.pump();
    bench.transmitter.begin();
    bench.link.left = 12'345;
    bench.transmitter.send(wire::BoardHello{});
    bench.transmitter.pump();
    CHECK(bench.received<wire::BoardHello>().size() == 1);
    CHECK(bench.received<wire::ClockFollowUp>().empty());
}

TEST_CASE("transmitter: a sample says how old it was as it left, or that nobody knows") {
    Bench bench;
    for (const Nanoseconds taken :
         {Nanoseconds{90'000}, Nanoseconds{40'000}, Nanoseconds{-5'000'000'000}}) {
        wire::ImuSample sample{};
        sample.time_ns = taken;
        bench.transmitter.send(sample);
    }
    bench.clock.time = 100'000;
    bench.link.space = 60;  // for the first, which is staged now
    bench.transmitter.pump();
    bench.clock.time = 190'000;
    bench.link.space = 1'000;
    bench.transmitter.pump();
    const auto samples = bench.received<wire::ImuSample>();
    REQUIRE(samples.size() == 3);
    CHECK(samples[0].departure_ns == 10'000);
    CHECK(samples[1].departure_ns == 150'000);
    CHECK(samples[2].departure_ns == 0);
}

TEST_CASE("transmitter: one pump writes a bounded part, and says that there is more") {
    Bench bench;
    for (unsigned i = 1; i <= 10; ++i) bench.transmitter.send(exposure(i));
    bench.link.space = 100'000;
    CHECK(bench.transmitter.pump());
    CHECK(bench.link.bytes.size() == 256);
    CHECK(bench.transmitter.pump());
    while (bench.transmitter.pump()) continue;
    CHECK(bench.received<wire::Exposure>().size() == 10);
}
