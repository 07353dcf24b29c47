// SPDX-License-Identifier: BSD-3-Clause
#include "control/control_socket.hpp"

#include <grp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

namespace versavis::daemon {

namespace {

constexpr std::size_t most_clients = 16;

/// A call is a few hundred bytes.
constexpr std::size_t longest_message = 64 * 1024;

/// A client that leaves so much unread does not read.
constexpr std::size_t most_unread = 256 * 1024;

Unexpected<> not_made(const std::filesystem::path& path) {
    return failure(path.string(), std::strerror(errno), "check the rights of its folder");
}

/// As systemd-sysusers makes it; none: there is no such group.
std::optional<gid_t> group_id(const std::string& name) {
    std::array<char, 16384> room{};
    group entry{};
    group* found = nullptr;
    if (::getgrnam_r(name.c_str(), &entry, room.data(), room.size(), &found) != 0 ||
        found == nullptr)
        return std::nullopt;
    return entry.gr_gid;
}

}  // namespace

Expected<ControlSocket> ControlSocket::create(const std::filesystem::path& path,
                                              const std::string& group) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.native().size() >= sizeof address.sun_path)
        return failure(path.string(), "is too long for a socket", "choose a shorter instance");
    path.native().copy(address.sun_path, sizeof address.sun_path - 1);
    FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!socket) return not_made(path);
    ::unlink(path.c_str());
    const mode_t before = ::umask(0177);  // nobody else may connect before its group is set
    const bool bound =
        ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::umask(before);
    if (!bound || ::listen(socket.get(), most_clients) != 0) return not_made(path);
    const auto admins = group_id(group);
    if (admins && ::chown(path.c_str(), static_cast<uid_t>(-1), *admins) == 0)
        ::chmod(path.c_str(), 0660);
    return ControlSocket(path, std::move(socket));
}

ControlSocket::~ControlSocket() {
    if (socket_) ::unlink(path_.c_str());
}

void ControlSocket::poll(HostTime now,
                         const std::function<void(Client, const std::string&)>& handle) {
    accept(now);
    for (auto it = clients_.begin(); it != clients_.end();) {
        const Client client = it->first;
        Connection& connection = it->second;
        receive(connection, now);
        const std::size_t end = connection.received.find('\0');
        const bool whole = end != std::string::npos;
        if (whole && !connection.waits) {
            const std::string message = connection.received.substr(0, end);
            connection.received.erase(0, end + 1);
            connection.waits = true;
            handle(client, message);
        }
        const bool too_long = !whole && connection.received.size() > longest_message;
        const bool done = connection.ended && !whole && !connection.waits;
        const bool sent = flush(connection);
        const bool keep = sent && !too_long && !(done && connection.to_send.empty());
        it = keep ? std::next(it) : clients_.erase(it);
    }
}

void ControlSocket::accept(HostTime now) {
    for (;;) {
        FileDescriptor socket(
            ::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
        if (!socket) return;
        if (clients_.size() >= most_clients) make_room();
        Connection& connection = clients_[next_++];
        connection.socket = std::move(socket);
        connection.active = now;
    }
}

/// Who waits for an answer goes last; else who was idle longest goes first.
void ControlSocket::make_room() {
    const auto rank = [](const auto& entry) {
        return std::pair(entry.second.waits, entry.second.active.ns);
    };
    clients_.erase(
        std::min_element(clients_.begin(), clients_.end(),
                         [&](const auto& a, const auto& b) { return rank(a) < rank(b); }));
}

void ControlSocket::receive(Connection& client, HostTime now) {
    // What came is handled before more is taken: the kernel keeps the rest.
    if (client.ended || client.received.size() > longest_message) return;
    std::array<char, longest_message> bytes;  // NOLINT(cppcoreguidelines-pro-type-member-init)
    const ssize_t count = ::recv(client.socket.get(), bytes.data(), bytes.size(), 0);
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
    client.ended = count <= 0;
    if (client.ended) return;
    client.received.append(bytes.data(), static_cast<std::size_t>(count));
    client.active = now;
}

/// False: it is gone, or does not read.
bool ControlSocket::flush(Connection& client) {
    if (client.to_send.empty()) return true;
    const ssize_t count = ::send(client.socket.get(), client.to_send.data(), client.to_send.size(),
                                 MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) return false;
    if (count > 0) client.to_send.erase(0, static_cast<std::size_t>(count));
    return client.to_send.size() <= most_unread;
}

void ControlSocket::send(Client client, const std::string& message, bool last) {
    const auto found = clients_.find(client);
    if (found == clients_.end()) return;
    found->second.to_send += message;
    if (last) found->second.waits = false;
}

void ControlSocket::finish(Client client) { send(client, ""); }

}  // namespace versavis::daemon
