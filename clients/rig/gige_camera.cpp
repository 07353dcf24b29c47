// SPDX-License-Identifier: BSD-3-Clause
#include "gige_camera.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <system_error>

#include "bytes.hpp"
#include "posix/thread.hpp"

namespace versavis::rig {

namespace {

constexpr std::uint16_t gvcp_port = 3956;
constexpr std::uint8_t gvcp_key = 0x42;
constexpr std::uint8_t acknowledge_wanted = 0x01;
constexpr std::uint8_t action_scheduled = 0x80;
constexpr std::size_t discovery_size = 0xF8;
constexpr std::size_t most_memory = 512;
constexpr int poll_ms = 20;
constexpr int busy_poll_ms = 1;  ///< while answers or actions wait
constexpr std::uint32_t fire_bit = 1U << 31U;

enum Command : std::uint16_t {
    discovery = 0x0002,
    packet_resend = 0x0040,
    read_register = 0x0080,
    write_register_command = 0x0082,
    read_memory = 0x0084,
    write_memory = 0x0086,
    pending_acknowledge = 0x0089,
    action = 0x0100,
};

enum Status : std::uint16_t {
    success = 0x0000,
    not_implemented = 0x8001,
    invalid_parameter = 0x8002,
    invalid_address = 0x8003,
    access_denied = 0x8006,
    no_reference_time = 0x8013,
    overflow = 0x8015,
    action_late = 0x8016,
};

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
    return static_cast<std::uint32_t>(load_number(bytes.subspan(at, 4), std::endian::big));
}

std::uint16_t half(std::span<const std::uint8_t> bytes, std::size_t at) {
    return static_cast<std::uint16_t>(load_number(bytes.subspan(at, 2), std::endian::big));
}

void put_half(std::vector<std::uint8_t>& out, std::uint64_t value) {
    append_number(out, value, 2, std::endian::big);
}

bool same(const sockaddr_in& a, const sockaddr_in& b) {
    return a.sin_addr.s_addr == b.sin_addr.s_addr && a.sin_port == b.sin_port;
}

/// Receives broadcasts. Never on loopback: a rig there must not show up on the machine's real
/// networks.
FileDescriptor open_broadcast_socket(sockaddr_in self) {
    if ((ntohl(self.sin_addr.s_addr) >> 24U) == 127) return {};
    self.sin_addr.s_addr = INADDR_BROADCAST;
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    const int yes = 1;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self);
    return socket;
}

}  // namespace

Expected<std::unique_ptr<GigeCamera>> GigeCamera::create(const World& world,
                                                         const CameraScenario& settings) {
    const auto family = settings.model.empty() ? rig_family() : load_camera_family(settings.model);
    if (!family) return Unexpected(family.error());
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in self{};
    self.sin_family = AF_INET;
    self.sin_port = htons(gvcp_port);
    const int yes = 1;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    if (inet_pton(AF_INET, settings.address.c_str(), &self.sin_addr) != 1 ||
        ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self) != 0) {
        const std::string reason = std::generic_category().message(errno);
        return failure(
            fmt::format("camera {}", settings.name),
            fmt::format("cannot listen on {}:{}: {}", settings.address, gvcp_port, reason),
            "is another rig running? use other addresses of 127.0.0.0/8");
    }
    return std::unique_ptr<GigeCamera>(
        new GigeCamera(world, settings, *family, std::move(socket), open_broadcast_socket(self)));
}

GigeCamera::GigeCamera(const World& world, const CameraScenario& settings,
                       const CameraFamily& family, FileDescriptor socket,
                       FileDescriptor broadcast_socket)
    : hostility_(settings.hostility),
      answer_time_{std::llround(settings.answer_ms * 1e6)},
      socket_(std::move(socket)),
      broadcast_socket_(std::move(broadcast_socket)),
      transmitter_(settings.address, settings.link_mbps, settings.packet_loss, world.scenario.seed),
      events_(socket_.get()),
      camera_(world, settings, family, gige_memory(settings, family), *this) {
    configure_stream();
    server_ = start_thread("camera", [this] { serve(); });
}

GigeCamera::~GigeCamera() {
    stop_ = true;
    server_.join();
}

void GigeCamera::serve() {
    while (!stop_) {
        pollfd readable[] = {{socket_.get(), POLLIN, 0}, {broadcast_socket_.get(), POLLIN, 0}};
        ::poll(readable, 2, answers_.empty() && !camera_.awaits_action() ? poll_ms : busy_poll_ms);
        if (camera_.poll(host_now())) {
            lose_controller();
            configure_stream();
        }
        send_answers();
        for (const pollfd& entry : readable)
            if ((entry.revents & POLLIN) != 0) receive(entry.fd);
        const Duration silence = host_now() - last_contact_;
        if (controller_.sin_port != 0 && silence > milliseconds(registers_.value(reg_heartbeat_ms)))
            lose_controller();
    }
}

void GigeCamera::receive(int socket) {
    std::uint8_t buffer[2048];
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    const ssize_t size = ::recvfrom(socket, buffer, sizeof buffer, 0,
                                    reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size >= 8 && !camera_.muted()) handle({buffer, static_cast<std::size_t>(size)}, from);
}

void GigeCamera::handle(std::span<const std::uint8_t> packet, const sockaddr_in& from) {
    if (packet[0] != gvcp_key || packet.size() < 8U + half(packet, 4)) return;
    const std::uint16_t command = half(packet, 2);
    if (command == action) {
        const auto status = take_action(packet);
        if (!status) return;  // it is meant for others
        return reply(packet, *status, {}, from);
    }
    if (same(from, controller_)) last_contact_ = host_now();
    std::uint16_t status = success;
    const bool later = pending(command, packet.subspan(8, half(packet, 4)));
    const std::vector<std::uint8_t> body =
        later ? std::vector<std::uint8_t>{0, 0, 0xFF, 0xFF}
              : answer(command, packet.subspan(8, half(packet, 4)), from, status);
    reply(packet, status, body, from, later);
}

void GigeCamera::reply(std::span<const std::uint8_t> packet, std::uint16_t status,
                       const std::vector<std::uint8_t>& body, const sockaddr_in& to, bool later) {
    if ((packet[1] & acknowledge_wanted) == 0) return;
    std::vector<std::uint8_t> reply;
    put_half(reply, status);
    put_half(reply, later ? +pending_acknowledge : half(packet, 2) + 1U);
    put_half(reply, body.size());
    put_half(reply, half(packet, 6));
    reply.insert(reply.end(), body.begin(), body.end());
    answers_.push_back({host_now() + answer_time_, std::move(reply), to});
    send_answers();
}

/// Its status; none: its keys are not this camera's.
std::optional<std::uint16_t> GigeCamera::take_action(std::span<const std::uint8_t> packet) {
    const auto body = packet.subspan(8, half(packet, 4));
    if (body.size() < 12) return invalid_parameter;
    const bool meant = word(body, 0) == registers_.value(reg_action_device_key) &&
                       word(body, 4) == registers_.value(reg_action_group_key) &&
                       (word(body, 8) & registers_.value(reg_action_group_mask)) != 0 &&
                       registers_.value(reg_control_privilege) != 0;
    if (!meant) return std::nullopt;
    if ((packet[1] & action_scheduled) == 0 || body.size() < 20) return not_implemented;
    switch (camera_.schedule(std::uint64_t{word(body, 12)} << 32U | word(body, 16))) {
        case GenicamCamera::Action::no_time: return no_reference_time;
        case GenicamCamera::Action::queue_full: return overflow;
        case GenicamCamera::Action::late: return action_late;
        default: return success;
    }
}

void GigeCamera::send_answers() {
    for (; !answers_.empty() && answers_.front().due <= host_now(); answers_.pop_front()) {
        const Answer& due = answers_.front();
        ::sendto(socket_.get(), due.packet.data(), due.packet.size(), 0,
                 reinterpret_cast<const sockaddr*>(&due.to), sizeof due.to);
    }
}

/// In milliseconds, the longest that a device may ask for: a host that believes it waits a minute.
bool GigeCamera::pending(std::uint16_t command, std::span<const std::uint8_t> body) const {
    if (hostility_ == Hostility::pending_at_all) return command != discovery;
    const bool reads = command == read_register || command == read_memory;
    return hostility_ == Hostility::pending && reads && body.size() >= 4 &&
           word(body, 0) == reg_payload_size;
}

std::vector<std::uint8_t> GigeCamera::answer(std::uint16_t command,
                                             std::span<const std::uint8_t> body,
                                             const sockaddr_in& from, std::uint16_t& status) {
    std::vector<std::uint8_t> out;
    switch (command) {
        case discovery:
            out.resize(discovery_size);
            registers_.read(0, out);
            break;
        case read_register:
            out.resize(body.size() / 4 * 4);
            for (std::size_t at = 0; at < out.size(); at += 4)
                if (!registers_.read(word(body, at), std::span(out).subspan(at, 4)))
                    status = invalid_address;
            break;
        case write_register_command: {
            std::uint16_t done = 0;
            for (std::size_t at = 0; at + 8 <= body.size() && status == success; at += 8, ++done)
                status = write_register(word(body, at), word(body, at + 4), from);
            put_half(out, 0);
            put_half(out, done);
            break;
        }
        case read_memory: {
            const std::size_t size = body.size() >= 8 ? half(body, 6) : 0;
            if (size == 0 || size > most_memory) {
                status = invalid_parameter;
                break;
            }
            out.resize(4 + size);
            std::copy_n(body.begin(), 4, out.begin());
            if (!registers_.read(word(body, 0), std::span(out).subspan(4)))
                status = invalid_address;
            break;
        }
        case write_memory:
            if (body.size() % 4 != 0 || body.size() < 8) status = invalid_parameter;
            for (std::size_t at = 4; at + 4 <= body.size() && status == success; at += 4)
                status = write_register(word(body, 0) + static_cast<std::uint32_t>(at - 4),
                                        word(body, at), from);
            put_half(out, 0);
            put_half(out, body.size() - 4);
            break;
        case packet_resend:
            if (body.size() >= 20)
                transmitter_.resend(std::uint64_t{word(body, 12)} << 32U | word(body, 16),
                                    word(body, 4), word(body, 8));
            else if (body.size() >= 12)
                transmitter_.resend(half(body, 2), word(body, 4) & 0xFFFFFFU,
                                    word(body, 8) & 0xFFFFFFU);
            break;
        default: status = not_implemented;
    }
    return out;
}

bool GigeCamera::in_control(const sockaddr_in& from) const {
    return registers_.value(reg_control_privilege) != 0 && same(from, controller_);
}

std::uint16_t GigeCamera::write_register(std::uint32_t address, std::uint32_t value,
                                         const sockaddr_in& from) {
    if (address == reg_control_privilege) {
        const bool taken = registers_.value(reg_control_privilege) != 0 && !same(from, controller_);
        if (taken) return access_denied;
        controller_ = value != 0 ? from : sockaddr_in{};
        last_contact_ = host_now();
        if (value == 0) camera_.stop_acquisition();
    } else if (!in_control(from)) {
        return access_denied;
    }
    const bool fire_test_packet = address == reg_fire_test_packet ||
                                  (address == reg_stream_packet_size && (value & fire_bit) != 0);
    if (address == reg_stream_packet_size)
        value = std::clamp<std::uint32_t>(value & 0xFFFFU, 256, 16000) & ~3U;
    if (address < reg_user_name) return invalid_address;  // constant
    std::array<std::uint8_t, sizeof value> wire{};
    store_number(wire, value, std::endian::big);
    switch (camera_.write(address, wire)) {
        case GenicamCamera::Written::locked: return access_denied;
        case GenicamCamera::Written::no_such: return invalid_address;
        default: break;
    }
    switch (address) {
        case reg_stream_port:
        case reg_stream_packet_size:
        case reg_stream_packet_delay:
        case reg_stream_address: configure_stream(); break;
        case reg_message_port:
        case reg_message_address: configure_messages(); break;
        default: break;
    }
    if (fire_test_packet) transmitter_.send_test_packet();
    return success;
}

sockaddr_in GigeCamera::destination(GigeRegister address, GigeRegister port) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(registers_.value(port)));
    to.sin_addr.s_addr = htonl(registers_.value(address));
    return to;
}

void GigeCamera::configure_stream() {
    transmitter_.configure({destination(reg_stream_address, reg_stream_port),
                            registers_.value(reg_stream_packet_size),
                            registers_.value(reg_stream_packet_delay)});  // a tick is a nanosecond
    registers_.write(reg_stream_source_port, std::uint32_t{transmitter_.source_port()});
}

void GigeCamera::configure_messages() {
    events_.direct_to(destination(reg_message_address, reg_message_port));
}

void GigeCamera::lose_controller() {
    registers_.write(reg_control_privilege, std::uint32_t{0});
    registers_.write(reg_message_port, std::uint32_t{0});
    controller_ = {};
    configure_messages();
    camera_.stop_acquisition();
}

}  // namespace versavis::rig
