// SPDX-License-Identifier: BSD-3-Clause
#include "device/handshake.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis;
using namespace versavis::device;

namespace {

/// Hears hellos, and answers after some of them.
struct HandshakeListener {
    int answers_after = 1;
    std::vector<wire::Header> hellos{};
    std::vector<Duration> waits{};
    std::size_t bytes_before_first = 0;
    wire::Decoder decoder{};

    Expected<bool> greeted_by(Encoder& encoder) {
        return greet(
            encoder,
            [this](std::span<const std::uint8_t> bytes) -> Expected<> {
                if (hellos.empty() && bytes.size() == 1 && bytes.front() == 0) ++bytes_before_first;
                decoder.feed(bytes.data(), bytes.size(), [this](const wire::Packet& packet) {
                    wire::HostHello hello{};
                    REQUIRE(packet.read(hello));
                    CHECK(hello.major == wire::protocol_major);
                    CHECK(hello.minor == wire::protocol_minor);
                    hellos.push_back(packet.header);
                });
                return {};
            },
            [this](Duration timeout) -> Expected<bool> {
                waits.push_back(timeout);
                return static_cast<int>(hellos.size()) >= answers_after;
            });
    }
};

/// As it arrives.
template <class T>
std::optional<Greeting> read_back(const T& message) {
    Encoder encoder;
    const wire::Frame frame = encoder.encode(message);
    wire::Decoder decoder;
    std::optional<Greeting> greeting;
    decoder.feed(frame.bytes, frame.size,
                 [&](const wire::Packet& packet) { greeting = read_greeting(packet); });
    return greeting;
}

}  // namespace

TEST_CASE("handshake: hellos go on, numbered and under one nonce, until one is answered") {
    HandshakeListener board;
    board.answers_after = GENERATE(1, 3);
    // What was left unfinished before ends here.
    const std::uint8_t rest[]{7, 7};
    board.decoder.feed(rest, sizeof rest, [](const wire::Packet&) {});
    Encoder encoder;
    CHECK(*board.greeted_by(encoder));
    CHECK(board.bytes_before_first == 1);
    REQUIRE(static_cast<int>(board.hellos.size()) == board.answers_after);
    for (std::uint32_t i = 0; i < board.hellos.size(); ++i) {
        CHECK(board.hellos[i].sequence == i);
        CHECK(board.hellos[i].nonce == board.hellos.front().nonce);
    }
}

TEST_CASE("handshake: a board that does not answer is given up after 1.25 s") {
    HandshakeListener board;
    board.answers_after = 100;
    Encoder encoder;
    CHECK_FALSE(*board.greeted_by(encoder));
    CHECK(board.hellos.size() == 5);
    CHECK(board.waits == std::vector<Duration>(5, milliseconds(250)));
}

TEST_CASE("handshake: a link that fails ends it, with its own words") {
    Encoder encoder;
    int calls = 0;
    const auto fail = [&] {
        ++calls;
        return failure("link", "is gone");
    };
    SECTION("when it is written to") {
        const auto done = greet(
            encoder, [&](auto) -> Expected<> { return fail(); },
            [](Duration) -> Expected<bool> { return true; });
        REQUIRE_FALSE(done);
        CHECK(done.error().what == "is gone");
    }
    SECTION("while it is waited for") {
        const auto done = greet(
            encoder, [](auto) -> Expected<> { return {}; },
            [&](Duration) -> Expected<bool> { return fail(); });
        REQUIRE_FALSE(done);
        CHECK(done.error().what == "is gone");
    }
    CHECK(calls == 1);
}

TEST_CASE("handshake: a connection has a nonce of its own") {
    const auto nonce = [] {
        Encoder encoder;
        return read_back(wire::BoardHello{wire::protocol_major, 0, 0, {}, 0, 0, 0, 0, {}, {}})
            ->nonce;
    };
    CHECK(nonce() != nonce());
}

TEST_CASE("handshake: a greeting says who the board is") {
    wire::BoardHello hello{};
    hello.major = wire::protocol_major;
    hello.minor = 7;
    std::string("0123456789abcdef").copy(hello.serial, sizeof hello.serial);  // without end
    std::string("versavis 1.2").copy(hello.firmware, sizeof hello.firmware);
    const auto greeting = read_back(hello);
    REQUIRE(greeting);
    CHECK(greeting->understood);
    CHECK(greeting->serial() == "0123456789abcdef");
    CHECK(greeting->firmware() == "versavis 1.2");
    CHECK(greeting->hello.minor == 7);
}

TEST_CASE("handshake: of another major version only that is read") {
    wire::BoardHello hello{};
    hello.major = wire::protocol_major + 1;
    hello.minor = 2;
    std::string("abc").copy(hello.serial, sizeof hello.serial);
    const auto greeting = read_back(hello);
    REQUIRE(greeting);
    CHECK_FALSE(greeting->understood);
    CHECK(greeting->serial().empty());
    CHECK(greeting->firmware() ==
          "firmware of protocol " + std::to_string(wire::protocol_major + 1) + ".2");
}

TEST_CASE("handshake: another packet is no greeting") {
    CHECK_FALSE(read_back(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}}));
}
