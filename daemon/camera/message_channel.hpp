// SPDX-License-Identifier: BSD-3-Clause
// What a GigE Vision camera reports by itself: events of its exposures, sent to a socket of our
// own.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/camera_event.hpp"
#include "posix/file_descriptor.hpp"

namespace versavis::daemon {

/// Of GigE Vision's EVENT and EVENTDATA commands, before its kind is known.
struct EventItem {
    std::uint16_t id = 0;
    std::uint64_t block_id = 0;
    std::uint64_t ticks = 0;
};

struct EventPacket {
    std::uint16_t command = 0;
    std::uint16_t request = 0;
    bool acknowledge = false;  ///< the camera wants an answer
    std::vector<EventItem> items;
};

/// None: this is no whole event command.
std::optional<EventPacket> parse_events(std::span<const std::uint8_t> packet);

/// The answer to it.
std::vector<std::uint8_t> event_acknowledge(const EventPacket& packet);

/// An event that a camera may send, as its description numbers it.
struct EventNumber {
    std::uint16_t id;
    CameraEventKind kind;
};

/// Receives on a thread of its own until it ends. What another address sends is dropped.
class MessageChannel {
 public:
    using Sink = std::function<void(const CameraEvent&)>;

    /// Error: none; there is no socket to be had.
    static std::unique_ptr<MessageChannel> open(in_addr interface, in_addr camera,
                                                std::vector<EventNumber> numbers,
                                                std::uint64_t ticks_per_second, Sink sink);
    ~MessageChannel();
    MessageChannel(const MessageChannel&) = delete;
    MessageChannel& operator=(const MessageChannel&) = delete;

    std::uint16_t port() const { return port_; }

 private:
    MessageChannel(FileDescriptor socket, std::uint16_t port, in_addr camera,
                   std::vector<EventNumber> numbers, std::uint64_t ticks_per_second, Sink sink);

    void run();
    void receive();
    void take(const EventItem& item);

    FileDescriptor socket_;
    FileDescriptor stop_;
    std::uint16_t port_;
    in_addr camera_;
    std::vector<EventNumber> numbers_;
    std::uint64_t ticks_per_second_;
    Sink sink_;
    std::uint16_t newest_request_ = 0;  ///< a camera that gets no answer sends it again
    std::thread thread_;
};

/// GigE Vision bootstrap registers of the message channel.
inline constexpr std::uint32_t gvcp_message_port = 0x0B00;
inline constexpr std::uint32_t gvcp_message_address = 0x0B10;
inline constexpr std::uint32_t gvcp_message_timeout_ms = 0x0B14;
inline constexpr std::uint32_t gvcp_message_retries = 0x0B18;

}  // namespace versavis::daemon
