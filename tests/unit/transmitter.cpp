// SPDX-License-Identifier: BSD-3-Clause
#include "transmitter.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <utility>
#include <vector>

using namespace versavis;
using namespace versavis::firmware;

namespace {

struct SlowLink final : ByteLink {
    std::size_t space = 0;
    std::vector<std::uint8_t> bytes;
    std::size_t watched = 0;  ///< bytes that were written when it was asked
    Nanoseconds left = 0;     ///< 0: it does not report it
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

struct SendClock final : Clock64 {
    Nanoseconds time = 0;
    Nanoseconds now() override { return time; }
};

struct TransmitterBench {
    SlowLink link;
    SendClock clock;
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

wire::Exposure sent_exposure(std::uint64_t trigger) {
    wire::Exposure record{};
    record.trigger = trigger;
    return record;
}

using Numbers = std::vector<std::pair<wire::Type, std::uint32_t>>;

/// Sends `count` messages that carry their numbers. The newest `kept` of them are expected to leave
/// before all that was sent by earlier calls.
template <class T>
void fill(Transmitter& transmitter, std::uint32_t count, std::uint32_t kept, Numbers& expected) {
    Numbers numbers;
    for (std::uint32_t number = 1; number <= count; ++number) {
        T message{};
        std::memcpy(static_cast<void*>(&message), &number, sizeof number);
        transmitter.send(message);
        if (number + kept > count) numbers.emplace_back(T::type, number);
    }
    expected.insert(expected.begin(), numbers.begin(), numbers.end());
}

}  // namespace

TEST_CASE(
    "transmitter: what matters most leaves first, numbered as it leaves, in pieces as small as the "
    "link "
    "takes") {
    TransmitterBench bench;
    bench.transmitter.send(wire::Log{wire::LogLevel::info, "text"});
    bench.transmitter.send(wire::ImuSample{});
    bench.transmitter.send(sent_exposure(1));
    bench.transmitter.send(wire::Sentence{});
    bench.transmitter.send(wire::ClockAnswer{1, 0, 0, 0});
    do {
        bench.link.space = 7;
        bench.clock.time += 1000;
        CHECK_FALSE(bench.transmitter.pump());
    } while (bench.link.space == 0);
    const auto headers = bench.headers();
    REQUIRE(headers.size() == 5);
    const wire::Type order[] = {wire::Type::clock_answer, wire::Type::exposure,
                                wire::Type::imu_sample, wire::Type::sentence, wire::Type::log};
    for (std::uint32_t i = 0; i < 5; ++i) {
        CHECK(headers[i].type == order[i]);
        CHECK(headers[i].sequence == i);
    }
}

TEST_CASE(
    "transmitter: of each class the newest stay, whatever else waits, and the others are counted") {
    TransmitterBench bench;
    Transmitter& transmitter = bench.transmitter;
    Numbers expected;
    for (int round = 0; round < 2; ++round) {
        expected.clear();
        fill<wire::Log>(transmitter, 9, 8, expected);
        fill<wire::Sentence>(transmitter, 40, 32, expected);
        fill<wire::ImuSample>(transmitter, 258, 256, expected);
        fill<wire::Health>(transmitter, 4, 1, expected);
        fill<wire::ConfigurationAnswer>(transmitter, 7, 1, expected);
        fill<wire::Event>(transmitter, 132, 128, expected);
        fill<wire::Exposure>(transmitter, 261, 256, expected);
        fill<wire::Refusal>(transmitter, 55, 48, expected);
        fill<wire::ClockAnswer>(transmitter, 16, 8, expected);
        fill<wire::ClockFollowUp>(transmitter, 10, 1, expected);
        fill<wire::BoardHello>(transmitter, 11, 1, expected);
        CHECK(transmitter.take_high_water() == 740);

        bench.link.bytes.clear();
        bench.link.space = 1'000'000;
        while (transmitter.pump()) continue;
        Numbers received;
        wire::Decoder decoder;
        decoder.feed(bench.link.bytes.data(), bench.link.bytes.size(),
                     [&](const wire::Packet& packet) {
                         std::uint32_t number = 0;
                         std::memcpy(&number, packet.payload, sizeof number);
                         received.emplace_back(packet.header.type, number);
                     });
        CHECK(received == expected);
        CHECK(decoder.errors() == 0);
    }
    wire::Health health{};
    transmitter.count_drops(health);
    CHECK(health.dropped_logs == 2 * 1);
    CHECK(health.dropped_imu_samples == 2 * 2);
    CHECK(health.dropped_events == 2 * 4);
    CHECK(health.dropped_exposures == 2 * 5);
    CHECK(health.dropped_clock_answers == 2 * 8);
}

TEST_CASE("transmitter: what is stamped as it leaves lies where its words are aligned") {
    for (const wire::Type type : {wire::Type::clock_answer, wire::Type::imu_sample}) {
        const MessageQueue& queue = message_queues[queue_of(type)];
        CHECK(queue.offset % alignof(std::int64_t) == 0);
        CHECK(queue.message_size % alignof(std::int64_t) == 0);
    }
}

TEST_CASE("transmitter: the most that waited is reported since it was asked for last") {
    TransmitterBench bench;
    CHECK(bench.transmitter.take_high_water() == 0);
    for (unsigned i = 1; i <= 3; ++i) bench.transmitter.send(sent_exposure(i));
    bench.link.space = 100;  // one packet, and a part of the next
    bench.transmitter.pump();
    CHECK(bench.transmitter.take_high_water() == 3);
    CHECK(bench.transmitter.take_high_water() == 1);
    bench.transmitter.send(sent_exposure(4));
    CHECK(bench.transmitter.take_high_water() == 2);
    bench.link.space = 1'000;
    bench.transmitter.pump();
    CHECK(bench.transmitter.take_high_water() == 2);
    CHECK(bench.transmitter.take_high_water() == 0);
    bench.transmitter.send(sent_exposure(5));
    bench.transmitter.begin();
    CHECK(bench.transmitter.take_high_water() == 1);
    CHECK(bench.transmitter.take_high_water() == 0);
}

TEST_CASE(
    "transmitter: a new connection hears nothing of the one before, not even the rest of a "
    "packet") {
    TransmitterBench bench;
    bench.transmitter.send(sent_exposure(1));
    bench.transmitter.send(sent_exposure(2));
    bench.link.space = 20;
    bench.transmitter.pump();
    bench.transmitter.begin();
    bench.transmitter.send(wire::BoardHello{});
    bench.transmitter.send(wire::Log{wire::LogLevel::info, "text"});
    bench.link.space = 1'000;
    bench.transmitter.pump();
    const auto headers = bench.headers();
    REQUIRE(headers.size() == 2);
    CHECK(headers[0].type == wire::Type::board_hello);
    CHECK(headers[1].type == wire::Type::log);
    CHECK(headers[0].nonce == 7);
    CHECK(headers[0].sequence == 1);  // the first is lost on the line
}

TEST_CASE("transmitter: nothing to send is nothing written") {
    TransmitterBench bench;
    bench.link.space = 1'000;
    bench.link.left = 12'345;  // nobody asked
    CHECK_FALSE(bench.transmitter.pump());
    CHECK(bench.link.bytes.empty());
    bench.transmitter.begin();  // ends what the host may have got of a packet
    CHECK_FALSE(bench.transmitter.pump());
    CHECK_FALSE(bench.transmitter.pump());
    CHECK(bench.link.bytes == std::vector<std::uint8_t>{0});
}

TEST_CASE("transmitter: the time of sending is that at which the answer leaves") {
    TransmitterBench bench;
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
    "transmitter: when an answer left follows as soon as the link reports it, before all that "
    "waits") {
    TransmitterBench bench;
    bench.transmitter.send(wire::ClockAnswer{42, 0, 500, 0});
    bench.link.space = 20;  // less than the answer
    bench.transmitter.pump();
    CHECK(bench.link.watched == 0);
    bench.link.space = 1'000;
    bench.transmitter.pump();
    REQUIRE(bench.received<wire::ClockAnswer>().size() == 1);
    CHECK(bench.link.watched == bench.link.bytes.size());
    CHECK(bench.received<wire::ClockFollowUp>().empty());
    bench.transmitter.send(sent_exposure(1));
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

TEST_CASE("transmitter: of two answers, each is reported by its own number, and once") {
    TransmitterBench bench;
    bench.transmitter.send(wire::ClockAnswer{42, 0, 500, 0});
    bench.link.space = 1'000;
    bench.transmitter.pump();
    bench.transmitter.send(wire::ClockAnswer{43, 0, 600, 0});
    bench.link.space = 20;  // less than the answer
    bench.transmitter.pump();
    bench.link.left = 12'345;  // the first left while the second is written
    bench.link.space = 1'000;
    bench.transmitter.pump();
    bench.link.left = 23'456;
    bench.transmitter.pump();
    bench.link.left = 34'567;  // nobody asked
    bench.transmitter.pump();
    const auto follow_ups = bench.received<wire::ClockFollowUp>();
    REQUIRE(follow_ups.size() == 2);
    CHECK(follow_ups[0].id == 42);
    CHECK(follow_ups[0].reserved == 0);
    CHECK(follow_ups[0].sent_ns == 12'345);
    CHECK(follow_ups[1].id == 43);
    CHECK(follow_ups[1].sent_ns == 23'456);
}

TEST_CASE("transmitter: the departure of an answer that a new connection cuts is not asked for") {
    TransmitterBench bench;
    bench.transmitter.send(wire::ClockAnswer{42, 0, 500, 0});
    bench.link.space = 20;  // less than the answer
    bench.transmitter.pump();
    bench.transmitter.begin();
    bench.transmitter.send(wire::BoardHello{});
    bench.link.space = 1'000;
    bench.transmitter.pump();
    CHECK(bench.link.watched == 0);
}

TEST_CASE("transmitter: a new connection hears nothing of the departures of the one before") {
    TransmitterBench bench;
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
    TransmitterBench bench;
    bench.clock.time = 100'000;
    wire::ImuSample sample{};
    sample.time_ns = 90'000;
    bench.transmitter.send(sample);
    sample.time_ns = 40'000;
    bench.transmitter.send(sample);
    bench.link.space = 60;  // for the first, which is staged now
    bench.transmitter.pump();
    bench.clock.time = 190'000;
    bench.link.space = 1'000;
    bench.transmitter.pump();
    const Nanoseconds ages[] = {1, 0, -1, 0xFFFFFFFF, 0x100000000, 0x100000001, -0xFFFFFFFFLL};
    for (const Nanoseconds age : ages) {
        sample.time_ns = bench.clock.time - age;
        bench.transmitter.send(sample);
    }
    while (bench.transmitter.pump()) continue;
    std::vector<std::uint32_t> departures;
    for (const wire::ImuSample& received : bench.received<wire::ImuSample>())
        departures.push_back(received.departure_ns);
    CHECK(departures == std::vector<std::uint32_t>{10'000, 150'000, 1, 0, 0, 0xFFFFFFFF, 0, 0, 0});
}

TEST_CASE("transmitter: one pump writes a bounded part, and says whether the link takes more") {
    for (const std::size_t space : {std::size_t{255}, std::size_t{256}, std::size_t{257}}) {
        TransmitterBench bench;
        for (unsigned i = 1; i <= 10; ++i) bench.transmitter.send(sent_exposure(i));
        bench.link.space = space;
        CHECK(bench.transmitter.pump() == (space > 256));
        CHECK(bench.link.bytes.size() == (space < 256 ? space : 256));
        bench.link.space = 100'000;
        CHECK(bench.transmitter.pump());
        while (bench.transmitter.pump()) continue;
        CHECK(bench.received<wire::Exposure>().size() == 10);
    }
}
