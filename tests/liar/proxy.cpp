// SPDX-License-Identifier: BSD-3-Clause
#include "proxy.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <system_error>

#include "realtime.hpp"

namespace versavis::liar {

namespace {

constexpr int stop_noticed_ms = 50;

/// A host that reads nothing for this long is as good as gone; then the connection ends, and
/// nothing waits for ever.
constexpr timeval longest_write{2, 0};

sockaddr_un address_of(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    return address;
}

bool send_all(int socket, std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
        const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
        if (sent <= 0) return false;
        bytes = bytes.subspan(static_cast<std::size_t>(sent));
    }
    return true;
}

}  // namespace

Expected<std::unique_ptr<Proxy>> Proxy::start(const std::string& path,
                                              const std::string& board_path, Liar& liar) {
    const sockaddr_un self = address_of(path);
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (::bind(listener, reinterpret_cast<const sockaddr*>(&self), sizeof self) != 0 ||
        ::listen(listener, 1) != 0) {
        const std::string reason = std::generic_category().message(errno);
        ::close(listener);
        return failure(path, "cannot listen: " + reason, "choose another path");
    }
    return std::unique_ptr<Proxy>(new Proxy(listener, board_path, liar));
}

Proxy::Proxy(int listener, std::string board_path, Liar& liar)
    : listener_(listener), board_path_(std::move(board_path)), liar_(liar) {
    thread_ = std::thread([this] { run(); });
}

Proxy::~Proxy() {
    stop_ = true;
    thread_.join();
    disconnect();
    ::close(listener_);
}

void Proxy::run() {
    rig::run_like_hardware();
    while (!stop_) {
        pollfd readable[] = {{service_ < 0 ? listener_ : service_, POLLIN, 0}, {board_, POLLIN, 0}};
        if (::poll(readable, 2, stop_noticed_ms) <= 0) continue;
        if (service_ < 0) {
            connect_both();
            continue;
        }
        bool connected = true;
        if (readable[1].revents != 0) connected = pass_to_service();
        if (connected && readable[0].revents != 0) connected = pass_to_board();
        if (!connected) disconnect();
    }
}

void Proxy::connect_both() {
    service_ = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    ::setsockopt(service_, SOL_SOCKET, SO_SNDTIMEO, &longest_write, sizeof longest_write);
    const sockaddr_un board = address_of(board_path_);
    board_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (::connect(board_, reinterpret_cast<const sockaddr*>(&board), sizeof board) != 0)
        disconnect();
}

void Proxy::disconnect() {
    for (int* socket : {&service_, &board_}) {
        if (*socket >= 0) ::close(*socket);
        *socket = -1;
    }
    unfinished_.clear();
}

bool Proxy::pass_to_board() {
    std::uint8_t buffer[4096];
    const ssize_t size = ::recv(service_, buffer, sizeof buffer, 0);
    return size > 0 && send_all(board_, {buffer, static_cast<std::size_t>(size)});
}

bool Proxy::pass_to_service() {
    std::uint8_t buffer[4096];
    const ssize_t size = ::recv(board_, buffer, sizeof buffer, 0);
    if (size <= 0) return false;
    unfinished_.insert(unfinished_.end(), buffer, buffer + size);
    const HostTime now = host_now();
    Bytes out;
    auto begin = unfinished_.begin();
    for (auto end = std::find(begin, unfinished_.end(), 0); end != unfinished_.end();
         end = std::find(begin, unfinished_.end(), 0)) {
        if (const auto packet = decode({begin, end}))
            for (const Packet& passed : liar_.pass(*packet, now)) {
                const Bytes encoded = encode(passed);
                out.insert(out.end(), encoded.begin(), encoded.end());
            }
        begin = end + 1;
    }
    unfinished_.erase(unfinished_.begin(), begin);
    return send_all(service_, out);
}

}  // namespace versavis::liar
