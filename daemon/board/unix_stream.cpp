// SPDX-License-Identifier: BSD-3-Clause
#include "board/unix_stream.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "posix/file_descriptor.hpp"

namespace versavis::daemon {

namespace {

/// A board that does not take data for so long is gone.
constexpr int write_timeout_ms = 500;

class UnixStream final : public ByteStream {
 public:
    UnixStream(std::string path, FileDescriptor socket)
        : path_(std::move(path)), socket_(std::move(socket)) {}

    std::string port() const override { return "unix:" + path_; }

    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        Chunk chunk;
        const std::int64_t wait_ns = std::max<std::int64_t>(timeout.ns, 0);
        const timespec limit{wait_ns / 1'000'000'000, wait_ns % 1'000'000'000};
        pollfd readable{socket_.get(), POLLIN, 0};
        if (::ppoll(&readable, 1, &limit, nullptr) <= 0) return chunk;
        const ssize_t size = ::recv(socket_.get(), into.data(), into.size(), 0);
        chunk.received = host_now();
        if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR))
            return failure(path_, "the board closed the link");
        chunk.size = static_cast<std::size_t>(std::max<ssize_t>(size, 0));
        return chunk;
    }

    Expected<> write(std::span<const std::uint8_t> bytes) override {
        while (!bytes.empty()) {
            const ssize_t size = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
            if (size > 0) {
                bytes = bytes.subspan(static_cast<std::size_t>(size));
                continue;
            }
            pollfd writable{socket_.get(), POLLOUT, 0};
            if (errno != EAGAIN || ::poll(&writable, 1, write_timeout_ms) <= 0)
                return failure(path_, "the board does not accept data");
        }
        return {};
    }

 private:
    std::string path_;
    FileDescriptor socket_;
};

}  // namespace

Expected<std::unique_ptr<ByteStream>> open_unix_stream(const std::string& path) {
    sockaddr_un peer{};
    peer.sun_family = AF_UNIX;
    if (path.size() >= sizeof peer.sun_path)
        return failure("board.link", "the path of the socket is too long");
    std::memcpy(peer.sun_path, path.c_str(), path.size() + 1);
    // A socket that blocks would wait here for as long as the board's queue is full.
    FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer) != 0) {
        const int error = errno;
        if (error == EAGAIN)
            return failure(
                path, "the board's process does not accept the connection",
                "another program may be connected: stop it, or restart the board's process");
        return failure(path,
                       fmt::format("cannot connect: {}", std::generic_category().message(error)),
                       "is the board's process (versavis-rig) running?");
    }
    return std::make_unique<UnixStream>(path, std::move(socket));
}

}  // namespace versavis::daemon
