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
constexpr std::uint8_t unacknowledged = 0xA5;

/// An IMU that answers with its input bytes over and over, and now and then not at all.
firmware::Environment babbling(std::span<const std::uint8_t> bytes) {
    firmware::Environment environment;
    environment.imu_transfer = [bytes, next = std::size_t{0}](auto, const auto&,
                                                              auto received) mutable {
        for (std::uint8_t& byte : received)
            byte = bytes.empty() ? 0xFF : bytes[next++ % bytes.size()];
        return received.empty() || received.back() != unacknowledged;
    };
    return environment;
}

/// What the part can have.
std::uint8_t imu_options(wire::ImuKind kind, std::uint8_t choice) {
    unsigned options = choice & wire::imu_data_ready;
    if (kind == wire::ImuKind::bmi088 && options != 0) options |= wire::imu_accel_ready;
    if (kind == wire::ImuKind::icm42688p && options != 0 && (choice & 2U) != 0)
        options |= wire::imu_i2c | (choice & wire::imu_i2c_second);
    return static_cast<std::uint8_t>(options);
}

/// Something of everything.
wire::Configuration full_configuration(std::uint8_t choice) {
    wire::Configuration configuration{};
    for (unsigned i = 0; i < wire::camera_count; ++i)
        configuration.cameras[i] = {wire::camera_enabled | (choice >> i & 1U) << 1U,
                                    200'000'000,
                                    0,
                                    10'000,
                                    0,
                                    0,
                                    1'000'000,
                                    4'000'000,
                                    0,
                                    choice,
                                    {}};
    configuration.cameras[3].flags |= wire::camera_slave;
    const auto kind = static_cast<wire::ImuKind>(1 + choice % 7);
    configuration.imus[0] = {kind, 0, imu_options(kind, choice), 0,
                             kind < wire::ImuKind::adis16460 ? 800'000U : 1'000'000U};
    configuration.imus[1] = {wire::ImuKind::vn100, 0, 1, 0, 800'000};
    configuration.illumination = {15, 0, 0, 100'000, 2'000'000, 300'000};
    const bool own_rate = (choice & 64U) != 0;
    configuration.ports = {15,
                           0,
                           wire::port_imu_output,
                           own_rate ? wire::test_rate : wire::test_camera0,
                           10'000'000,
                           10'000,
                           0,
                           own_rate ? 10'000'000U : 0U,
                           wire::test_at_test,
                           {}};
    return configuration;
}

template <class T>
void send(firmware::NativeBoard& board, const T& message) {
    wire::Frame frame{};
    wire::encode(message, 1, 0, frame);
    board.receive({frame.bytes, frame.size}, 0);
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
        wire::HelloVersion version{};
        const bool foreign = packet.read(version) && version.major != wire::protocol_major;
        if (!foreign && wire::payload_size(packet.header.type) != 0 &&
            wire::payload_size(packet.header.type) != packet.payload_size)
            std::abort();
        ++packets;
    });
    if (packets + decoder.errors() > size) std::abort();

    const std::span<const std::uint8_t> bytes(data, size);
    firmware::NativeBoard board({1, wire::ResetCause::power_on, "FUZZ"}, babbling(bytes));
    send(board, wire::HostHello{wire::protocol_major, 0, {}});
    send(board, full_configuration(size == 0 ? 0 : data[0]));
    board.run_until(0);
    send(board, wire::Start{15, 0, {}});
    firmware::Nanoseconds now = 0;
    // A chunk is an edge, bytes of the IMU on the UART, or a packet, as its first byte says.
    for (std::span<const std::uint8_t> rest = bytes; !rest.empty();) {
        const std::uint8_t head = rest[0];
        const std::size_t wanted = head >= 0xE0   ? 1
                                   : head >= 0xC0 ? head & 0x1FU
                                                  : 2 * std::size_t{head};
        const auto chunk = rest.subspan(1, std::min(rest.size() - 1, wanted));
        if (head >= 0xE0)
            board.schedule_edge(
                {now, static_cast<std::uint8_t>((head >> 1U & 0xFU) % firmware::input_count),
                 (head & 1U) != 0});
        else if (head >= 0xC0)
            board.uart_receive(chunk, now);
        else
            feed_as_packet(board, chunk, now);
        now += step_ns;
        board.run_until(now);
        board.consume(board.transmitted().size(), 0);
        rest = rest.subspan(1 + chunk.size());
    }
    board.run_until(now + 100 * step_ns);
    return 0;
}
