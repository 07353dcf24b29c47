// SPDX-License-Identifier: BSD-3-Clause
#include "camera/gvcp.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "settings/device_name.hpp"

namespace versavis::daemon {

namespace {

constexpr std::uint8_t acknowledge = 0x01;
constexpr std::uint8_t acknowledge_by_broadcast = 0x11;
constexpr std::uint16_t discovery = 0x0002;
constexpr std::uint16_t read_register_command = 0x0080;
constexpr std::uint16_t read_memory = 0x0084;
constexpr std::size_t discovery_size = 0xF8;
constexpr std::size_t read_size = 512;  ///< the most that a device must deliver at once

/// Between the first two questions to one address, and then twice as long each time, because a slow
/// camera answers all of them before anything else.
constexpr Duration ask_interval = milliseconds(50);

/// Until a question is asked again, of a camera that has not shown that it takes longer.
constexpr Duration answer_time = milliseconds(200);

std::vector<OwnInterface> own_interfaces() {
    std::vector<OwnInterface> found;
    ifaddrs* all = nullptr;
    if (getifaddrs(&all) != 0) return found;
    const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(all, &freeifaddrs);
    for (const ifaddrs* entry = all; entry != nullptr; entry = entry->ifa_next)
        if (entry->ifa_addr != nullptr && entry->ifa_addr->sa_family == AF_INET &&
            entry->ifa_netmask != nullptr && (entry->ifa_flags & IFF_UP) != 0)
            found.push_back({entry->ifa_name,
                             reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr,
                             reinterpret_cast<const sockaddr_in*>(entry->ifa_netmask)->sin_addr});
    return found;
}

sockaddr_in endpoint(in_addr address, std::uint16_t at) {
    sockaddr_in end{};
    end.sin_family = AF_INET;
    end.sin_addr = address;
    end.sin_port = htons(at);
    return end;
}

FileDescriptor open_socket(in_addr interface) {
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    const sockaddr_in own = endpoint(interface, 0);
    const int yes = 1;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) return {};
    return socket;
}

std::uint32_t word_at(const std::uint8_t* bytes) {
    return std::uint32_t{half_at(bytes)} << 16U | half_at(bytes + 2);
}

/// A field of a device's own texts: up to its first zero, and printable.
std::string field(const std::uint8_t* bytes, std::size_t size) {
    std::string text(bytes, std::find(bytes, bytes + size, 0));
    for (char& letter : text)
        if (letter < ' ' || letter > '~') letter = '?';
    return text;
}

NetworkDevice describe(const std::uint8_t* registers, in_addr interface) {
    NetworkDevice device;
    device.interface = interface;
    device.address.s_addr = htonl(word_at(registers + 0x24));
    device.mac = fmt::format("{:02x}", fmt::join(registers + 0x0A, registers + 0x10, ":"));
    device.vendor = field(registers + 0x48, 32);
    device.model = field(registers + 0x68, 32);
    device.version = field(registers + 0x88, 32);
    device.serial = field(registers + 0xD8, 16);
    device.user_name = field(registers + 0xE8, 16);
    return device;
}

bool goes_by(const NetworkDevice& device, const std::string& name) {
    for (const std::string& own :
         {device.mac, device.serial, device.user_name, device.vendor + "-" + device.serial})
        if (!own.empty() && same_device(own, name)) return true;
    return false;
}

/// Waits for one of the sockets, and looks at `cancelled` meanwhile. False: it is time to go on.
bool readable(std::vector<pollfd>& sockets, HostTime until, const Cancelled& cancelled) {
    for (Duration left = until - host_now(); left.ns > 0; left = until - host_now()) {
        if (cancelled()) return false;
        const timespec pause{0, std::min(left, cancelled_interval).ns};
        if (::ppoll(sockets.data(), sockets.size(), &pause, nullptr) > 0) return true;
    }
    return false;
}

}  // namespace

std::optional<in_addr> parse_address(const std::string& text) {
    in_addr address{};
    return inet_pton(AF_INET, text.c_str(), &address) == 1 ? std::optional(address) : std::nullopt;
}

std::string to_text(in_addr address) {
    char text[INET_ADDRSTRLEN]{};
    return inet_ntop(AF_INET, &address, text, sizeof text);
}

CameraTime camera_time(std::uint64_t ticks, std::uint64_t ticks_per_second) {
    // In two parts, so that no product overflows.
    constexpr std::uint64_t second_ns = 1'000'000'000;
    const std::uint64_t ns =
        ticks / ticks_per_second * second_ns +
        static_cast<std::uint64_t>(static_cast<double>(ticks % ticks_per_second) * 1e9 /
                                   static_cast<double>(ticks_per_second));
    return {static_cast<std::int64_t>(ns)};
}

bool in_own_network(in_addr address) {
    const auto interfaces = own_interfaces();
    return std::any_of(interfaces.begin(), interfaces.end(),
                       [&](const OwnInterface& own) { return own.contains(address); });
}

std::string OwnInterface::text() const {
    const unsigned prefix = static_cast<unsigned>(std::popcount(mask.s_addr));
    return fmt::format("{} ({}/{})", name, to_text(address), prefix);
}

std::optional<OwnInterface> own_interface(in_addr address) {
    for (const OwnInterface& own : own_interfaces())
        if (own.address.s_addr == address.s_addr) return own;
    return std::nullopt;
}

DeviceSearch::DeviceSearch(std::string name)
    : name_(std::move(name)), address_(parse_address(name_)) {
    // A camera beyond a router answers to one of them; what is in an own network, to that one.
    const bool near = address_ && in_own_network(*address_);
    for (const OwnInterface& own : own_interfaces()) {
        if (near && !own.contains(*address_)) continue;
        auto socket = open_socket(own.address);
        if (!socket) continue;
        sockets_.push_back({std::move(socket), own.address});
        if (!address_) add_broadcast_receiver(sockets_.back());
    }
}

/// A camera of another subnet may answer by broadcast, which a socket with an address of its own
/// does not get.
void DeviceSearch::add_broadcast_receiver(const Socket& socket) {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(socket.descriptor.get(), reinterpret_cast<sockaddr*>(&own), &size);
    FileDescriptor receiver(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    own.sin_addr = {INADDR_BROADCAST};
    if (::bind(receiver.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0)
        receivers_.push_back({std::move(receiver), socket.interface});
}

void DeviceSearch::ask() const {
    std::vector<std::uint8_t> packet{gvcp_key, address_ ? acknowledge : acknowledge_by_broadcast};
    put(packet, discovery, 2);
    put(packet, 0, 2);
    put(packet, 0xFFFF, 2);
    const sockaddr_in to = endpoint(address_.value_or(in_addr{INADDR_BROADCAST}), gvcp_port);
    for (const Socket& socket : sockets_)
        ::sendto(socket.descriptor.get(), packet.data(), packet.size(), 0,
                 reinterpret_cast<const sockaddr*>(&to), sizeof to);
}

std::optional<NetworkDevice> DeviceSearch::receive(const Socket& socket) const {
    std::uint8_t packet[gvcp_header_size + 1024];
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    const ssize_t size = ::recvfrom(socket.descriptor.get(), packet, sizeof packet, 0,
                                    reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size < static_cast<ssize_t>(gvcp_header_size + discovery_size) ||
        half_at(packet + 2) != discovery + 1)
        return std::nullopt;
    NetworkDevice device = describe(packet + gvcp_header_size, socket.interface);
    if (!address_)
        return name_.empty() || goes_by(device, name_) ? std::optional(device) : std::nullopt;
    if (from.sin_addr.s_addr != address_->s_addr) return std::nullopt;
    device.address = *address_;
    return device;
}

void DeviceSearch::look(Duration patience, const Cancelled& cancelled,
                        const std::function<bool(const NetworkDevice&)>& enough) {
    std::vector<pollfd> polled;
    for (const auto* sockets : {&sockets_, &receivers_})
        for (const Socket& socket : *sockets)
            polled.push_back({socket.descriptor.get(), POLLIN, 0});
    const HostTime deadline = host_now() + patience;
    // All that a broadcast reaches answers at once: it is not repeated as often.
    Duration interval = address_ ? ask_interval : ask_interval * 10;
    for (HostTime asked; host_now() < deadline && !cancelled();) {
        if (host_now() - asked >= interval) {
            ask();
            if (asked.ns != 0 && address_) interval = interval * 2;
            asked = host_now();
        }
        if (!readable(polled, std::min(deadline, asked + interval), cancelled)) continue;
        for (const auto* sockets : {&sockets_, &receivers_})
            for (const Socket& socket : *sockets)
                if (const auto device = receive(socket); device && enough(*device)) return;
    }
}

std::optional<NetworkDevice> DeviceSearch::wait(Duration patience, const Cancelled& cancelled) {
    std::optional<NetworkDevice> found;
    look(patience, cancelled, [&](const NetworkDevice& device) {
        found = device;
        return true;
    });
    return found;
}

std::vector<NetworkDevice> DeviceSearch::collect(Duration patience) {
    std::vector<NetworkDevice> found;
    look(
        patience, [] { return false; },
        [&](const NetworkDevice& device) {
            const auto same = [&](const NetworkDevice& other) {
                return other.mac == device.mac && other.interface.s_addr == device.interface.s_addr;
            };
            if (std::none_of(found.begin(), found.end(), same)) found.push_back(device);
            return false;
        });
    return found;
}

GvcpClient::GvcpClient(in_addr interface, in_addr address)
    : name_(to_text(address)), socket_(open_socket(interface)), repeat_after_(answer_time) {
    const sockaddr_in to = endpoint(address, gvcp_port);
    ::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to);
}

std::optional<std::vector<std::uint8_t>> GvcpClient::request(std::uint16_t command,
                                                             const std::vector<std::uint8_t>& body,
                                                             std::size_t answer_size,
                                                             Duration patience,
                                                             const Cancelled& cancelled) {
    id_ = static_cast<std::uint16_t>(id_ % 0xFFFFU + 1U);  // zero is none
    std::vector<std::uint8_t> packet{gvcp_key, acknowledge};
    put(packet, command, 2);
    put(packet, static_cast<std::uint32_t>(body.size()), 2);
    put(packet, id_, 2);
    packet.insert(packet.end(), body.begin(), body.end());
    std::vector<pollfd> polled{{socket_.get(), POLLIN, 0}};
    const HostTime asked = host_now();
    const HostTime deadline = asked + patience;
    while (host_now() < deadline && !cancelled()) {
        ::send(socket_.get(), packet.data(), packet.size(), 0);
        const HostTime again = std::min(deadline, host_now() + repeat_after_);
        while (readable(polled, again, cancelled)) {
            std::uint8_t answer[gvcp_header_size + read_size + 4];
            const ssize_t size = ::recv(socket_.get(), answer, sizeof answer, 0);
            if (size < 0) break;  // nobody listens there: it may boot
            const bool ours = size >= static_cast<ssize_t>(gvcp_header_size) &&
                              half_at(answer + 2) == command + 1 && half_at(answer + 6) == id_;
            if (!ours) continue;  // late, or "pending"
            repeat_after_ = std::max(answer_time, (host_now() - asked) * 2);
            if (half_at(answer) != 0 || size < static_cast<ssize_t>(gvcp_header_size + answer_size))
                return std::nullopt;
            return std::vector<std::uint8_t>(answer + gvcp_header_size,
                                             answer + gvcp_header_size + answer_size);
        }
        if (host_now() < again) {  // refused at once
            const timespec pause{0, cancelled_interval.ns};
            nanosleep(&pause, nullptr);
        }
    }
    return std::nullopt;
}

Expected<std::vector<std::uint8_t>> GvcpClient::read(std::uint32_t address, std::size_t size,
                                                     Duration patience,
                                                     const Cancelled& cancelled) {
    std::vector<std::uint8_t> all;
    all.reserve(size);
    while (all.size() < size) {
        const std::size_t left = std::min(read_size, (size - all.size() + 3) / 4 * 4);
        std::vector<std::uint8_t> body;
        put(body, address + static_cast<std::uint32_t>(all.size()), 4);
        put(body, static_cast<std::uint32_t>(left), 4);
        const auto answer = request(read_memory, body, 4 + left, patience, cancelled);
        if (!answer)
            return failure(
                name_, fmt::format("does not deliver its memory at {:#x}", address + all.size()),
                "power it off and on");
        all.insert(all.end(), answer->begin() + 4, answer->end());
    }
    all.resize(size);
    return all;
}

std::optional<std::uint32_t> GvcpClient::read_register(std::uint32_t address, Duration patience) {
    std::vector<std::uint8_t> body;
    put(body, address, 4);
    const auto answer = request(read_register_command, body, 4, patience, [] { return false; });
    return answer ? std::optional(word_at(answer->data())) : std::nullopt;
}

}  // namespace versavis::daemon
