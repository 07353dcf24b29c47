// SPDX-License-Identifier: BSD-3-Clause
// Any bytes, in any cuts, to both ends of the wire: the decoder, and a whole board behind it.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "native_board.hpp"

using namespace versavis;

namespace {

constexpr firmware::Nanoseconds step_ns = 200'000;

firmware::Surroundings nothing_connected() {
    firmware::Surroundings surroundings;
    surroundings.outputs_changed = [](auto, auto) {};
    surroundings.imu_burst = [](auto, auto, auto received) {
        std::fill(received.begin(), received.end(), std::uint8_t{0});
    };
    surroundings.reboot = [](bool) {};
    return surroundings;
}

/// Wraps the input as a packet with a valid CRC, so that what lies behind it is reached, too.
void feed_as_packet(firmware::NativeBoard& board, std::span<const std::uint8_t> bytes,
                    firmware::Nanoseconds at) {
    std::uint8_t raw[wire::max_packet_size] = {};
    const std::size_t body = std::min(bytes.size(), sizeof raw - wire::crc_size);
    std::copy_n(bytes.begin(), body, raw);
    const std::uint32_t crc = wire::crc32(raw, body);
    std::memcpy(raw + body, &crc, wire::crc_size);
    std::uint8_t encoded[wire::max_frame_size];
    std::size_t size = wire::cobs_encode(raw, body + wire::crc_size, encoded);
    encoded[size++] = 0;
    board.receive({encoded, size}, at);
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer looks for this name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    wire::Decoder decoder;
    std::uint32_t packets = 0;
    decoder.feed(data, size, [&](const wire::Packet& packet) {
        if (wire::payload_size(packet.header.type) != 0 &&
            wire::payload_size(packet.header.type) != packet.payload_size)
            std::abort();
        ++packets;
    });
    if (packets + decoder.errors() > size) std::abort();

    firmware::NativeBoard board({1, wire::ResetCause::power_on, "FUZZ"}, nothing_connected());
    wire::Frame hello{};
    wire::encode(wire::HostHello{wire::protocol_major, 0, {}}, 1, 0, hello);
    board.receive({hello.bytes, hello.size}, 0);
    board.run_until(0);
    firmware::Nanoseconds now = 0;
    // Each packet is as long as its first byte says.
    for (std::span<const std::uint8_t> rest(data, size); !rest.empty();) {
        const std::size_t length = std::min<std::size_t>(rest.size(), 1 + rest[0]);
        feed_as_packet(board, rest.subspan(1, length - 1), now);
        now += step_ns;
        board.run_until(now);
        board.consume(board.transmitted().size());
        rest = rest.subspan(length);
    }
    board.run_until(now + 10 * step_ns);
    return 0;
}
