// SPDX-License-Identifier: BSD-3-Clause
#include "foreign_packet.hpp"

#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>
#include <string>

using namespace versavis::liar;

namespace {

/// The test vector `name: <hexadecimal>` of the document, without its final zero.
Bytes vector_of_document(const std::string& name) {
    std::ifstream file(VERSAVIS_SOURCE_DIR "/docs/contracts/wire-protocol.md");
    Bytes bytes;
    for (std::string line; std::getline(file, line);) {
        if (line.rfind(name + ": ", 0) != 0) continue;
        for (std::size_t at = name.size() + 2; at + 1 < line.size(); at += 2)
            bytes.push_back(static_cast<std::uint8_t>(std::stoul(line.substr(at, 2), nullptr, 16)));
    }
    REQUIRE(bytes.size() > 1);
    REQUIRE(bytes.back() == 0);
    bytes.pop_back();
    return bytes;
}

}  // namespace

TEST_CASE("foreign packet: the document's vectors are read, and written again as they were") {
    const Bytes encoded = vector_of_document("exposure");
    const auto packet = decode(encoded);
    REQUIRE(packet);
    CHECK(packet->type == Type::exposure);
    CHECK(packet->nonce == 0xA1B2C3D4);
    CHECK(packet->sequence == 5);
    CHECK(get(*packet, exposure::camera) == 1);
    CHECK(get(*packet, exposure::flags) == 1);
    CHECK(get(*packet, exposure::trigger) == 7);
    CHECK(get(*packet, exposure::tick) == 9);
    CHECK(get(*packet, exposure::trigger_time) == 1'000'000'000);
    CHECK(get(*packet, exposure::start) == 1'000'020'000);
    CHECK(get(*packet, exposure::end) == 1'003'020'000);

    const auto answer = decode(vector_of_document("clock-answer"));
    REQUIRE(answer);
    CHECK(get(*answer, clock_answer::id) == 42);
    CHECK(get(*answer, clock_answer::received) == 123456789);
    CHECK(get(*answer, clock_answer::sent) == 123459876);

    const auto follow_up = decode(vector_of_document("clock-follow-up"));
    REQUIRE(follow_up);
    CHECK(get(*follow_up, clock_follow_up::id) == 42);
    CHECK(get(*follow_up, clock_follow_up::sent) == 123469876);

    const auto pps = decode(vector_of_document("event"));
    REQUIRE(pps);
    CHECK(get(*pps, event::sequence) == 17);
    CHECK(get(*pps, event::time) == 5'000'000'123);
    CHECK(get(*pps, event::value) == 3);

    for (const char* name : {"exposure", "clock-answer", "clock-follow-up", "event",
                             "configuration", "host-hello", "start"}) {
        Bytes expected = vector_of_document(name);
        const auto decoded = decode(expected);
        REQUIRE(decoded);
        expected.push_back(0);
        CHECK(encode(*decoded) == expected);
    }
}

TEST_CASE("foreign packet: any changed bit is seen by the CRC") {
    const Bytes encoded = vector_of_document("event");
    for (std::size_t bit = 0; bit < encoded.size() * 8; ++bit) {
        Bytes damaged = encoded;
        damaged[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
        CHECK_FALSE(decode(damaged));
    }
    CHECK_FALSE(decode({}));
}

TEST_CASE("foreign packet: long runs without a zero, as long as a block and longer") {
    for (const std::size_t size : {230U, 237U, 238U, 239U, 240U, 300U, 496U}) {
        Packet packet{Type::log, 0x01010101, 0x02020202, Bytes(size, 0x55)};
        Bytes encoded = encode(packet);
        REQUIRE(encoded.back() == 0);
        encoded.pop_back();
        CHECK(std::find(encoded.begin(), encoded.end(), 0) == encoded.end());
        const auto decoded = decode(encoded);
        REQUIRE(decoded);
        CHECK(decoded->payload == packet.payload);
    }
}

TEST_CASE("foreign packet: a field keeps its neighbours as they are") {
    Packet packet{Type::imu_sample, 1, 2, Bytes(56, 0xA5)};
    set(packet, imu_sample::number, 0x0102030405);
    CHECK(get(packet, imu_sample::number) == 0x02030405);
    CHECK(packet.payload[3] == 0xA5);
    CHECK(packet.payload[8] == 0xA5);
    set(packet, imu_sample::time, -2);
    CHECK(get(packet, imu_sample::time) == -2);
}
