// SPDX-License-Identifier: BSD-3-Clause
#include "camera/message_channel.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>

#include "camera/gvcp.hpp"
#include "posix/thread.hpp"

namespace versavis::daemon {

namespace {

constexpr std::uint8_t wants_acknowledge = 0x01;
constexpr std::uint8_t extended_ids = 0x10;
constexpr std::uint16_t event_command = 0x00C0;
constexpr std::uint16_t event_data_command = 0x00C2;

/// An item: reserved or its size, event, stream channel and block id in 16 bits each, with extended
/// ids a block id of 64 bits, and the time stamp.
constexpr std::size_t item_size = 16;
constexpr std::size_t extended_item_size = 24;

/// The most that a GVCP packet can carry. What is longer is cut, and refused.
constexpr std::size_t largest_packet = 576;

std::uint64_t number(std::span<const std::uint8_t> bytes, std::size_t at, unsigned size) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < size; ++i) value = value << 8U | bytes[at + i];
    return value;
}

EventItem item_at(std::span<const std::uint8_t> bytes, bool extended) {
    EventItem item;
    item.id = static_cast<std::uint16_t>(number(bytes, 2, 2));
    item.block_id = extended ? number(bytes, 8, 8) : number(bytes, 6, 2);
    item.ticks = number(bytes, extended ? 16 : 8, 8);
    return item;
}

}  // namespace

std::optional<EventPacket> parse_events(std::span<const std::uint8_t> packet) {
    if (packet.size() < gvcp_header_size || packet[0] != gvcp_key) return std::nullopt;
    EventPacket parsed;
    parsed.command = static_cast<std::uint16_t>(number(packet, 2, 2));
    parsed.request = static_cast<std::uint16_t>(number(packet, 6, 2));
    parsed.acknowledge = (packet[1] & wants_acknowledge) != 0;
    const bool extended = (packet[1] & extended_ids) != 0;
    const std::size_t size = extended ? extended_item_size : item_size;
    const bool data = parsed.command == event_data_command;
    const std::size_t length = number(packet, 4, 2);
    if ((!data && parsed.command != event_command) || parsed.request == 0 ||
        length > packet.size() - gvcp_header_size)
        return std::nullopt;
    auto body = packet.subspan(gvcp_header_size, length);
    // Data of a length that only the event's maker knows follow the first item.
    const std::size_t items =
        data ? std::min<std::size_t>(body.size() / size, 1) : body.size() / size;
    if (items == 0) return std::nullopt;
    for (std::size_t i = 0; i < items; ++i)
        parsed.items.push_back(item_at(body.subspan(i * size, size), extended));
    return parsed;
}

std::vector<std::uint8_t> event_acknowledge(const EventPacket& packet) {
    const auto command = static_cast<std::uint16_t>(packet.command + 1);
    const auto high = [](std::uint16_t value) { return static_cast<std::uint8_t>(value >> 8U); };
    const auto low = [](std::uint16_t value) { return static_cast<std::uint8_t>(value); };
    return {0, 0, high(command), low(command), 0, 0, high(packet.request), low(packet.request)};
}

std::unique_ptr<MessageChannel> MessageChannel::open(in_addr interface, in_addr camera,
                                                     std::vector<EventNumber> numbers,
                                                     std::uint64_t ticks_per_second, Sink sink) {
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr = interface;
    socklen_t size = sizeof own;
    if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0 ||
        ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own), &size) != 0)
        return nullptr;
    return std::unique_ptr<MessageChannel>(
        new MessageChannel(std::move(socket), ntohs(own.sin_port), camera, std::move(numbers),
                           ticks_per_second, std::move(sink)));
}

MessageChannel::MessageChannel(FileDescriptor socket, std::uint16_t port, in_addr camera,
                               std::vector<EventNumber> numbers, std::uint64_t ticks_per_second,
                               Sink sink)
    : socket_(std::move(socket)),
      stop_(::eventfd(0, EFD_CLOEXEC)),
      port_(port),
      camera_(camera),
      numbers_(std::move(numbers)),
      ticks_per_second_(ticks_per_second),
      sink_(std::move(sink)),
      thread_(start_thread("messages", [this] { run(); })) {}

MessageChannel::~MessageChannel() {
    ::eventfd_write(stop_.get(), 1);
    thread_.join();
}

void MessageChannel::run() {
    for (;;) {
        pollfd ready[] = {{socket_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
        if (::poll(ready, 2, -1) < 0) continue;  // stop_ ends it
        if (ready[1].revents != 0) return;
        receive();
    }
}

void MessageChannel::receive() {
    std::uint8_t packet[largest_packet + 1];
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    const ssize_t size = ::recvfrom(socket_.get(), packet, sizeof packet, 0,
                                    reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size < 0 || static_cast<std::size_t>(size) > largest_packet ||
        from.sin_addr.s_addr != camera_.s_addr)
        return;
    const auto events = parse_events({packet, static_cast<std::size_t>(size)});
    if (!events) return;
    if (events->acknowledge) {
        const auto answer = event_acknowledge(*events);
        ::sendto(socket_.get(), answer.data(), answer.size(), 0,
                 reinterpret_cast<const sockaddr*>(&from), sizeof from);
    }
    if (events->request == newest_request_) return;  // it had no answer in time
    newest_request_ = events->request;
    for (const EventItem& item : events->items) take(item);
}

void MessageChannel::take(const EventItem& item) {
    const auto known = std::find_if(numbers_.begin(), numbers_.end(),
                                    [&](const EventNumber& event) { return event.id == item.id; });
    if (known == numbers_.end() || ticks_per_second_ == 0) return;
    sink_({known->kind, item.block_id, camera_time(item.ticks, ticks_per_second_)});
}

}  // namespace versavis::daemon
