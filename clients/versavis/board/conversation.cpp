// SPDX-License-Identifier: BSD-3-Clause
#include "board/conversation.hpp"

#include <array>
#include <optional>

namespace versavis::client {

namespace {

/// Packets of the board that one read takes.
constexpr std::size_t largest_read = 4096;

}  // namespace

device::UsbExpected<Conversation> Conversation::open(const device::UsbDevice& device) {
    auto handle = device.open();
    if (!handle) return Unexpected(handle.error());
    auto port = device::CdcPort::open(std::move(*handle));
    if (!port) return Unexpected(port.error());
    return Conversation(std::move(*port), "board at " + device.port());
}

Expected<> Conversation::write(std::span<const std::uint8_t> bytes) {
    if (auto done = port_.write(bytes); !done)
        return Unexpected(done.error().as_error(where_, "cannot be written to"));
    return {};
}

Expected<device::Greeting> Conversation::greet() {
    std::optional<device::Greeting> greeting;
    const auto read = [&](const wire::Packet& packet) {
        greeting = device::read_greeting(packet);
        return greeting.has_value();
    };
    const auto answered = device::greet(
        encoder_, [this](auto bytes) { return write(bytes); },
        [&](Duration timeout) { return listen(read, timeout); });
    if (!answered) return Unexpected(answered.error());
    if (*answered) return *greeting;
    return failure(where_, "does not answer", "reconnect it, or flash it: versavis flash");
}

Expected<bool> Conversation::listen(const std::function<bool(const wire::Packet&)>& take,
                                    Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    std::array<std::uint8_t, largest_read> bytes{};
    for (bool found = false;;) {
        const Duration left = deadline - host_now();
        if (left.ns <= 0) return false;
        const auto size = port_.read(bytes, left);
        if (!size && size.error().fault == device::UsbFault::late) return false;
        if (!size) return Unexpected(size.error().as_error(where_, "cannot be read"));
        decoder_.feed(bytes.data(), *size,
                      [&](const wire::Packet& packet) { found = found || take(packet); });
        if (found) return true;
    }
}

}  // namespace versavis::client
