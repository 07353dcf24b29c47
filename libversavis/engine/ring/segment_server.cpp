// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/segment_server.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <system_error>

#include "posix/thread.hpp"

namespace versavis::ring {

namespace {

/// Connections that may be pending.
constexpr int waiting = 64;

/// Before the next try when no descriptor or memory is available. If lower, a service that is short
/// of both spends more on it; if higher, clients that connect then wait longer.
constexpr auto pause = std::chrono::milliseconds(10);

Unexpected<> not_made(const std::filesystem::path& path) {
    return failure(
        path.string(),
        fmt::format("cannot be made a socket: {}", std::generic_category().message(errno)),
        "does its directory belong to the service's user?");
}

/// The address of a file that is open, or of one in a directory that is: it holds 107 characters,
/// and a path may be longer.
sockaddr_un address_of(const FileDescriptor& file, const std::string& name = {}) {
    const std::string path = fmt::format("/proc/self/fd/{}{}", file.get(), name);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path);  // zero-terminated or full
    return address;
}

/// Never waits. A client that does not take it, or has left, gets nothing.
void hand_over(int segment, int connection) {
    char byte{};
    iovec data{&byte, sizeof byte};
    alignas(cmsghdr) char room[CMSG_SPACE(sizeof segment)]{};
    msghdr message{};
    message.msg_iov = &data;
    message.msg_iovlen = 1;
    message.msg_control = room;
    message.msg_controllen = sizeof room;
    cmsghdr* rights = CMSG_FIRSTHDR(&message);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof segment);
    std::memcpy(CMSG_DATA(rights), &segment, sizeof segment);
    ::sendmsg(connection, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace

Expected<std::unique_ptr<SegmentServer>> SegmentServer::open(const std::filesystem::path& path,
                                                             FileDescriptor segment) {
    const FileDescriptor directory(::open(path.parent_path().c_str(), O_PATH | O_CLOEXEC));
    FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    if (!directory || !socket) return not_made(path);
    const sockaddr_un address = address_of(directory, "/" + path.filename().string());
    ::unlink(path.c_str());
    if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::chmod(path.c_str(), 0660) != 0 ||  // whatever umask says
        ::listen(socket.get(), waiting) != 0)
        return not_made(path);
    std::unique_ptr<SegmentServer> server(new SegmentServer(std::move(segment), std::move(socket)));
    try {
        server->thread_ = start_thread("server", [self = server.get()] { self->serve(); });
    } catch (const std::system_error& error) {
        return failure(path.string(), fmt::format("cannot start a thread: {}", error.what()),
                       "raise the limit on tasks");
    }
    return server;
}

bool SegmentServer::is_deserted(const std::filesystem::path& path) {
    const FileDescriptor file(::open(path.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC));
    const FileDescriptor client(
        ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    struct stat found {};
    if (!file || !client || ::fstat(file.get(), &found) != 0 || !S_ISSOCK(found.st_mode))
        return false;
    const sockaddr_un address = address_of(file);
    return ::connect(client.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) !=
               0 &&
           errno == ECONNREFUSED;
}

SegmentServer::SegmentServer(FileDescriptor segment, FileDescriptor socket)
    : segment_(std::move(segment)), socket_(std::move(socket)) {}

SegmentServer::~SegmentServer() {
    ::shutdown(socket_.get(), SHUT_RDWR);  // accept() returns
    if (thread_.joinable()) thread_.join();
}

void SegmentServer::serve() const {
    for (;;) {
        const FileDescriptor connection(::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
        if (connection)
            hand_over(segment_.get(), connection.get());
        else if (errno == EINVAL)
            return;
        else
            std::this_thread::sleep_for(pause);
    }
}

}  // namespace versavis::ring
