// SPDX-License-Identifier: BSD-3-Clause
#include "event_sender.hpp"

#include <sys/socket.h>

#include <chrono>
#include <vector>

#include "bytes.hpp"

namespace versavis::rig {

namespace {

constexpr std::uint8_t gvcp_key = 0x42;
constexpr std::uint8_t acknowledge_wanted = 0x01;
constexpr std::uint8_t extended_ids = 0x10;
constexpr std::uint16_t event_command = 0x00C0;

void put(std::vector<std::uint8_t>& out, std::uint64_t value, std::size_t size) {
    append_number(out, value, size, std::endian::big);
}

/// GigE Vision's EVENT command with one event.
std::vector<std::uint8_t> command(const TimedEvent& event, std::uint16_t request) {
    const unsigned size = event.extended_id ? 24 : 16;
    std::vector<std::uint8_t> out{gvcp_key, acknowledge_wanted};
    if (event.extended_id) out[1] |= extended_ids;
    put(out, event_command, 2);
    put(out, size, 2);
    put(out, request, 2);
    put(out, event.extended_id ? size : 0, 2);
    put(out, static_cast<std::uint16_t>(event.id), 2);
    put(out, 0, 2);  // stream channel
    put(out, event.extended_id ? 0 : event.block_id, 2);
    if (event.extended_id) put(out, event.block_id, 8);
    put(out, event.ticks, 8);
    return out;
}

}  // namespace

EventSender::~EventSender() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        wake_.notify_all();
    }
    thread_.join();
}

void EventSender::direct_to(const sockaddr_in& destination) {
    const std::lock_guard lock(mutex_);
    destination_ = destination;
}

void EventSender::send(HostTime due, const TimedEvent& event) {
    const std::lock_guard lock(mutex_);
    if (destination_.sin_port == 0) return;
    events_.emplace(due, event);
    wake_.notify_all();
}

void EventSender::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        if (events_.empty()) {
            wake_.wait(lock);
            continue;
        }
        const auto next = events_.begin();
        const Duration left = next->first - host_now();
        if (left.ns > 0) {
            wake_.wait_for(lock, std::chrono::nanoseconds(left.ns));
            continue;
        }
        transmit(next->second);
        events_.erase(next);
    }
}

void EventSender::transmit(const TimedEvent& event) {
    request_ = static_cast<std::uint16_t>(request_ % 0xFFFFU + 1U);
    const auto packet = command(event, request_);
    ::sendto(socket_, packet.data(), packet.size(), 0,
             reinterpret_cast<const sockaddr*>(&destination_), sizeof destination_);
}

}  // namespace versavis::rig
