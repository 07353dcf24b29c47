// SPDX-License-Identifier: BSD-3-Clause
#include "board/conversation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

namespace versavis::client {

namespace {

// Of USB's CDC class.
constexpr std::uint8_t class_control = 0x02;
constexpr std::uint8_t class_data = 0x0A;
constexpr std::uint8_t class_interface_out = 0x21;
constexpr std::uint8_t set_line_coding = 0x20;
constexpr std::uint8_t set_control_line_state = 0x22;
constexpr std::uint16_t dtr_rts = 0x03;

/// 1200 baud, 8N1.
std::array<std::uint8_t, 7> touch_coding{0xB0, 0x04, 0, 0, 0, 0, 8};

/// For a request or a write. At half, a board that erases its flash is taken for gone; at twice,
/// one that hangs is told later.
constexpr Duration transfer_timeout = milliseconds(500);

/// Hellos until the board is given up, and the time for the answer to each. At half, a board that
/// boots is missed; at twice, one that hangs is told later.
constexpr int hello_attempts = 5;
constexpr Duration hello_timeout = milliseconds(250);

/// Packets of the board that one read takes. At half, a burst takes twice the reads; at twice,
/// nothing gains.
constexpr std::size_t largest_read = 4096;

std::string text(const char* padded, std::size_t capacity) {
    return {padded, strnlen(padded, capacity)};
}

}  // namespace

std::string Greeting::serial() const { return text(hello.serial, sizeof hello.serial); }

std::string Greeting::firmware() const {
    if (understood) return text(hello.firmware, sizeof hello.firmware);
    return fmt::format("firmware of protocol {}.{}", hello.major, hello.minor);
}

Conversation::Conversation(UsbHandle handle, int control, UsbFunction data, std::string where)
    : handle_(std::move(handle)),
      control_(control),
      data_(data),
      where_(std::move(where)),
      nonce_(std::random_device{}()) {}

UsbExpected<Conversation> Conversation::open(const UsbDevice& device) {
    auto handle = device.open();
    if (!handle) return Unexpected(handle.error());
    const UsbFunction control = handle->function(class_control);
    const UsbFunction data = handle->function(class_data);
    if (control.interface < 0 || !data.complete())
        return Unexpected(UsbError{UsbFault::foreign, 0});
    for (const int interface : {control.interface, data.interface})
        if (auto claimed = handle->claim(interface); !claimed) return Unexpected(claimed.error());
    Conversation conversation(std::move(*handle), control.interface, data,
                              "board at " + device.port());
    // A board without it still hears.
    static_cast<void>(conversation.handle_.control(class_interface_out, set_control_line_state,
                                                   dtr_rts, control.interface, {},
                                                   transfer_timeout));
    return conversation;
}

Expected<> Conversation::write(std::span<const std::uint8_t> bytes) {
    if (auto done = handle_.write(data_.endpoint_out, bytes, transfer_timeout); !done)
        return Unexpected(done.error().as_error(where_, "cannot be written to"));
    return {};
}

Expected<> Conversation::say_hello() {
    // A delimiter first: whatever an earlier connection left unfinished ends here.
    const std::uint8_t delimiter = 0;
    if (auto sent = write({&delimiter, 1}); !sent) return sent;
    return send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
}

Expected<Greeting> Conversation::greet() {
    Greeting greeting;
    const auto answered = [&](const wire::Packet& packet) {
        wire::HelloVersion version{};
        if (!packet.read(version)) return false;
        greeting.understood = version.major == wire::protocol_major;
        greeting.hello.major = version.major;
        greeting.hello.minor = version.minor;
        greeting.nonce = packet.header.nonce;
        return !greeting.understood || packet.read(greeting.hello);
    };
    for (int attempt = 0; attempt < hello_attempts; ++attempt) {
        if (auto sent = say_hello(); !sent) return Unexpected(sent.error());
        auto heard = listen(answered, hello_timeout);
        if (!heard) return Unexpected(heard.error());
        if (*heard) return greeting;
    }
    return failure(where_, "does not answer", "reconnect it, or flash it: versavis flash");
}

Expected<bool> Conversation::listen(const std::function<bool(const wire::Packet&)>& take,
                                    Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    std::array<std::uint8_t, largest_read> bytes{};
    for (bool found = false;;) {
        const Duration left = deadline - host_now();
        if (left.ns <= 0) return false;
        const auto size = handle_.read(data_.endpoint_in, bytes, left);
        if (!size && size.error().fault == UsbFault::late) return false;
        if (!size) return Unexpected(size.error().as_error(where_, "cannot be read"));
        decoder_.feed(bytes.data(), *size,
                      [&](const wire::Packet& packet) { found = found || take(packet); });
        if (found) return true;
    }
}

void Conversation::touch() {
    // It may go away before it has answered.
    static_cast<void>(handle_.control(class_interface_out, set_line_coding, 0, control_,
                                      touch_coding, transfer_timeout));
    static_cast<void>(handle_.control(class_interface_out, set_control_line_state, 0, control_, {},
                                      transfer_timeout));
}

}  // namespace versavis::client
