// SPDX-License-Identifier: BSD-3-Clause
#include "device/handshake.hpp"

#include <fmt/format.h>

#include "engine/board/board_words.hpp"

namespace versavis::device {

std::string Greeting::serial() const { return board::text(hello.serial); }

std::string Greeting::firmware() const {
    if (understood) return board::text(hello.firmware);
    return fmt::format("firmware of protocol {}.{}", hello.major, hello.minor);
}

std::optional<Greeting> read_greeting(const wire::Packet& packet) {
    wire::HelloVersion version{};
    if (!packet.read(version)) return std::nullopt;
    Greeting greeting;
    greeting.understood = version.major == wire::protocol_major;
    greeting.nonce = packet.header.nonce;
    greeting.hello.major = version.major;
    greeting.hello.minor = version.minor;
    if (greeting.understood && !packet.read(greeting.hello)) return std::nullopt;
    return greeting;
}

Expected<bool> greet(Encoder& encoder,
                     const std::function<Expected<>(std::span<const std::uint8_t>)>& write,
                     const std::function<Expected<bool>(Duration)>& answered) {
    const wire::HostHello hello{wire::protocol_major, wire::protocol_minor, {}};
    const std::uint8_t delimiter = 0;
    for (int attempt = 0; attempt < hello_attempts; ++attempt) {
        // A delimiter first: whatever an earlier connection left unfinished ends here.
        if (auto sent = write({&delimiter, 1}); !sent) return Unexpected(sent.error());
        const wire::Frame frame = encoder.encode(hello);
        if (auto sent = write({frame.bytes, frame.size}); !sent) return Unexpected(sent.error());
        auto done = answered(hello_timeout);
        if (!done || *done) return done;
    }
    return false;
}

}  // namespace versavis::device
