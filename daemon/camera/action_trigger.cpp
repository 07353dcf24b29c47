// SPDX-License-Identifier: BSD-3-Clause
#include "camera/action_trigger.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include "camera/gvcp.hpp"
#include "posix/thread.hpp"

namespace versavis::daemon {

namespace {

constexpr std::uint16_t action_command = 0x0100;
constexpr std::uint16_t action_acknowledge = 0x0101;
constexpr std::uint8_t flag_scheduled = 0x80;
constexpr std::uint8_t flag_acknowledge = 0x01;

/// Keys and mask, and the time.
constexpr unsigned action_size = 3 * 4 + 8;

}  // namespace

std::vector<std::uint8_t> scheduled_action(CameraTime at, std::uint16_t request) {
    std::vector<std::uint8_t> packet{gvcp_key, flag_scheduled | flag_acknowledge};
    put(packet, action_command, 2);
    put(packet, action_size, 2);
    put(packet, request, 2);
    put(packet, action_device_key, 4);
    put(packet, action_group_key, 4);
    put(packet, action_group_mask, 4);
    put(packet, static_cast<std::uint64_t>(at.ns), 8);
    return packet;
}

std::optional<std::uint16_t> action_status(std::span<const std::uint8_t> packet,
                                           std::uint16_t request) {
    if (packet.size() < gvcp_header_size || half_at(packet.data() + 2) != action_acknowledge ||
        half_at(packet.data() + 6) != request)
        return std::nullopt;
    return half_at(packet.data());
}

std::unique_ptr<ActionTrigger> ActionTrigger::create(in_addr interface, in_addr camera,
                                                     CameraPipeline& pipeline) {
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr = interface;
    sockaddr_in to = own;
    to.sin_addr = camera;
    to.sin_port = htons(gvcp_port);
    if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0 ||
        ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) != 0)
        return nullptr;
    return std::unique_ptr<ActionTrigger>(new ActionTrigger(std::move(socket), pipeline));
}

ActionTrigger::ActionTrigger(FileDescriptor socket, CameraPipeline& pipeline)
    : socket_(std::move(socket)),
      stop_(::eventfd(0, EFD_CLOEXEC)),
      pipeline_(pipeline),
      thread_(start_thread("trigger " + pipeline.name(), [this] { run(); })) {}

ActionTrigger::~ActionTrigger() {
    ::eventfd_write(stop_.get(), 1);
    thread_.join();
}

void ActionTrigger::run() {
    for (;;) {
        const CameraPipeline::PtpTurn turn = pipeline_.next_ptp_trigger(host_now());
        if (turn.trigger) {
            request_ = static_cast<std::uint16_t>(request_ % 0xFFFFU + 1U);  // zero is none
            trigger_ = turn.trigger->number;
            const auto packet = scheduled_action(turn.trigger->at, request_);
            ::send(socket_.get(), packet.data(), packet.size(), 0);
        }
        pollfd ready[] = {{socket_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
        const timespec wait{0, turn.wait.ns};
        if (::ppoll(ready, 2, &wait, nullptr) < 0) continue;
        if (ready[1].revents != 0) return;
        if (ready[0].revents != 0) receive();
    }
}

void ActionTrigger::receive() {
    std::uint8_t packet[gvcp_header_size + 64];
    const ssize_t size = ::recv(socket_.get(), packet, sizeof packet, 0);
    if (size < 0) return;  // nobody listens there: it may boot
    const auto status = action_status({packet, static_cast<std::size_t>(size)}, request_);
    if (status) pipeline_.acknowledge(trigger_, *status);
}

}  // namespace versavis::daemon
