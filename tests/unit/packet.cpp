// SPDX-License-Identifier: BSD-3-Clause
#include "wire/packet.hpp"

#include <rapidcheck.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

using namespace versavis::wire;
using Bytes = std::vector<std::uint8_t>;

namespace {

template <class T>
Bytes encoded(const T& message, std::uint32_t nonce, std::uint32_t sequence) {
    Frame frame{};
    encode(message, nonce, sequence, frame);
    return {frame.bytes, frame.bytes + frame.size};
}

std::vector<Header> decoded(Decoder& decoder, const Bytes& bytes) {
    std::vector<Header> headers;
    decoder.feed(bytes.data(), bytes.size(),
                 [&](const Packet& packet) { headers.push_back(packet.header); });
    return headers;
}

Exposure example_exposure() {
    Exposure exposure{};
    exposure.camera = 1;
    exposure.flags = exposure_measured;
    exposure.trigger = 7;
    exposure.tick = 9;
    exposure.trigger_ns = 1'000'000'000;
    exposure.start_ns = 1'000'020'000;
    exposure.end_ns = 1'003'020'000;
    return exposure;
}

std::string hex(const Bytes& bytes) {
    std::ostringstream out;
    for (const std::uint8_t byte : bytes) out << std::hex << (byte >> 4U) << (byte & 15U);
    return out.str();
}

Configuration example_configuration() {
    Configuration configuration{};
    configuration.id = 1;
    configuration.cameras[0].flags = camera_enabled;
    configuration.cameras[0].rate_uhz = 20'000'000;
    configuration.cameras[0].pulse_ns = 100'000;
    configuration.cameras[0].latency_ns = 20'000;
    configuration.cameras[0].exposure_ns = 3'000'000;
    configuration.cameras[0].max_exposure_ns = 40'000'000;
    configuration.imus[0] = {ImuKind::adis16448b, 0, imu_data_ready, 0, 819'200};
    configuration.ports.inputs = 1U << pulse_pps;
    return configuration;
}

TimeOutput example_time_output() {
    TimeOutput message{};
    message.board_ns = 7'000'000'250;
    message.utc_s = 1'798'761'600;
    message.pace_ppb = -25'000;
    message.delay_ns = 12'500;
    message.pulse_ns = 50'000'000;
    message.baud = 9'600;
    message.holdover_s = 30;
    message.sentence_delay_ms = 60;
    message.index = 1;
    message.output = test_at_sync;
    message.flags = time_known | time_serial_inverted;
    message.sentences = sentence_rmc | sentence_gga;
    message.talker[0] = 'G';
    message.talker[1] = 'P';
    return message;
}

Sentence example_sentence() {
    Sentence message{};
    message.time_ns = 7'100'000'000;
    message.sequence = 3;
    const std::string text = "$GPTXT,*2A";
    message.size = static_cast<std::uint8_t>(text.size());
    text.copy(message.text, sizeof message.text);
    return message;
}

/// The line "name: bytes" of the test vectors in the protocol document.
std::string documented(const std::string& name) {
    std::ifstream document(VERSAVIS_SOURCE_DIR "/docs/contracts/wire-protocol.md");
    for (std::string line; std::getline(document, line);)
        if (line.rfind(name + ": ", 0) == 0) return line.substr(name.size() + 2);
    return "not in the document";
}

}  // namespace

TEST_CASE("packet: the test vectors of the document") {
    CHECK(hex(encoded(HostHello{3, 3, {}}, 0x11223344, 0)) == documented("host-hello"));
    CHECK(hex(encoded(example_exposure(), 0xA1B2C3D4, 5)) == documented("exposure"));
    CHECK(hex(encoded(ClockRequest{42, 0}, 0x11223344, 3)) == documented("clock-request"));
    CHECK(hex(encoded(ClockAnswer{42, 0, 123456789, 123459876}, 0xA1B2C3D4, 6)) ==
          documented("clock-answer"));
    CHECK(hex(encoded(ClockFollowUp{42, 0, 123469876}, 0xA1B2C3D4, 8)) ==
          documented("clock-follow-up"));
    CHECK(hex(encoded(Start{0b0101, start_pattern, {}}, 0x11223344, 4)) == documented("start"));
    CHECK(hex(encoded(AlignGrid{7'000'000'250, -25'000, 20'000}, 0x11223344, 5)) ==
          documented("align-grid"));
    CHECK(hex(encoded(example_time_output(), 0x11223344, 6)) == documented("time-output"));
    CHECK(hex(encoded(example_sentence(), 0xA1B2C3D4, 9)) == documented("sentence"));
    CHECK(hex(encoded(Event{BoardEventKind::pps, 0, 0, 17, 5'000'000'123, 3}, 0xA1B2C3D4, 7)) ==
          documented("event"));
    CHECK(hex(encoded(example_configuration(), 0x11223344, 1)) == documented("configuration"));
}

TEST_CASE("packet: comes back as it was sent") {
    Decoder decoder;
    Exposure out{};
    const Bytes bytes = encoded(example_exposure(), 1, 2);
    decoder.feed(bytes.data(), bytes.size(), [&](const Packet& packet) {
        CHECK(packet.header.nonce == 1);
        CHECK(packet.header.sequence == 2);
        HostHello hello{};
        CHECK_FALSE(packet.read(hello));
        CHECK(packet.read(out));
    });
    CHECK(out.end_ns == 1'003'020'000);
    CHECK(decoder.errors() == 0);
}

TEST_CASE("packet: each corrupted bit is noticed") {
    const Bytes good = encoded(example_exposure(), 1, 2);
    for (std::size_t bit = 0; bit < (good.size() - 1) * 8; ++bit) {
        Bytes bad = good;
        bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
        Decoder decoder;
        CHECK(decoded(decoder, bad).empty());
    }
}

TEST_CASE("packet: a packet after rubbish is found, and the rubbish counted") {
    CHECK(rc::check([](const Bytes& rubbish) {
        Decoder decoder;
        decoded(decoder, rubbish);
        decoded(decoder, {0});
        const auto headers = decoded(decoder, encoded(example_exposure(), 1, 2));
        RC_ASSERT(headers.size() == 1);
        RC_ASSERT(headers[0].type == Type::exposure);
    }));
    Decoder decoder;
    decoded(decoder, Bytes(5000, 1));
    decoded(decoder, {0});
    CHECK(decoder.errors() == 1);
}

TEST_CASE("packet: an unknown type is passed on, a known one of the wrong size is not") {
    std::uint8_t raw[sizeof(Header) + 3 + crc_size] = {0x70};
    const auto send = [&](std::uint8_t type) {
        raw[0] = type;
        const std::uint32_t crc = crc32(raw, sizeof raw - crc_size);
        std::memcpy(raw + sizeof raw - crc_size, &crc, crc_size);
        Bytes bytes(cobs_bound(sizeof raw));
        bytes.resize(cobs_encode(raw, sizeof raw, bytes.data()));
        bytes.push_back(0);
        return bytes;
    };
    Decoder decoder;
    CHECK(decoded(decoder, send(0x70)).size() == 1);
    CHECK(decoded(decoder, send(static_cast<std::uint8_t>(Type::exposure))).empty());
    CHECK(decoder.errors() == 1);
}

TEST_CASE("packet: a hello of another major version is passed on, whatever its size") {
    const auto send = [](std::uint8_t major, std::size_t payload) {
        Bytes raw(sizeof(Header) + payload + crc_size);
        raw[0] = static_cast<std::uint8_t>(Type::board_hello);
        if (payload > 0) raw[sizeof(Header)] = major;
        if (payload > 1) raw[sizeof(Header) + 1] = 7;
        const std::uint32_t crc = crc32(raw.data(), raw.size() - crc_size);
        std::memcpy(raw.data() + raw.size() - crc_size, &crc, crc_size);
        Bytes bytes(cobs_bound(raw.size()));
        bytes.resize(cobs_encode(raw.data(), raw.size(), bytes.data()));
        bytes.push_back(0);
        return bytes;
    };
    const auto heard = [&](std::uint8_t major, std::size_t payload) {
        Decoder decoder;
        const Bytes bytes = send(major, payload);
        HelloVersion version{};
        decoder.feed(bytes.data(), bytes.size(), [&](const Packet& packet) {
            CHECK(packet.read(version));
            BoardHello hello{};
            CHECK(packet.read(hello) == (payload == sizeof hello));
        });
        CHECK(decoder.errors() == (version.major == 0 ? 1 : 0));
        return version.major * 256 + version.minor;
    };
    for (const std::size_t payload : {std::size_t{2}, std::size_t{48}, sizeof(BoardHello)})
        CHECK(heard(2, payload) == 0x207);
    CHECK(heard(4, 100) == 0x407);
    CHECK(heard(protocol_major, sizeof(BoardHello)) == protocol_major * 256 + 7);
    CHECK(heard(protocol_major, 48) == 0);
    CHECK(heard(2, 1) == 0);
    CHECK(heard(2, 0) == 0);
}
