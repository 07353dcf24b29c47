// SPDX-License-Identifier: BSD-3-Clause
#include "client/sealed.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

#include "client/error_code.hpp"

namespace versavis::ring {

namespace {

/// A service passes a segment on at once. If lower, one that is slowed by load looks stuck; if
/// higher, a stopped service delays a program for longer for each of its streams.
constexpr timeval patience{1, 0};

constexpr int seals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE;

Unexpected<> not_handed(const std::filesystem::path& path) {
    if (errno == ECONNREFUSED)
        return failure(ErrorCode::absent, path.string(), "no such stream: its service has died",
                       "see its log ('journalctl -u versavisd'), then restart it");
    if (errno == EACCES)
        return failure(ErrorCode::forbidden, path.string(), "permission denied",
                       "join the group that may read streams (usually 'versavis')");
    return failure(code_of(errno), path.string(),
                   "was not handed over by the service: " +
                       std::error_code(errno, std::generic_category()).message(),
                   "does it hang? see its log ('journalctl -u versavisd')");
}

/// The descriptor that came with a byte, which says nothing; none: errno says why.
FileDescriptor receive(int connection) {
    char byte = 0;  // read all the same: without it QEMU's user mode hands over no descriptor
    iovec data{&byte, sizeof byte};
    alignas(cmsghdr) char room[CMSG_SPACE(sizeof(int))]{};
    msghdr message{};
    message.msg_iov = &data;
    message.msg_iovlen = 1;
    message.msg_control = room;
    message.msg_controllen = CMSG_LEN(sizeof(int));  // a second descriptor does not come in
    if (::recvmsg(connection, &message, MSG_CMSG_CLOEXEC) < 0) return {};
    errno = EPROTO;
    // Nothing but descriptors comes to a socket that asked for nothing else.
    const cmsghdr* rights = CMSG_FIRSTHDR(&message);
    if (rights == nullptr) return {};
    int file = 0;
    std::memcpy(&file, CMSG_DATA(rights), sizeof file);
    return FileDescriptor(file);
}

bool is_of(int connection, std::uint32_t owner) {
    ucred peer{};
    socklen_t size = sizeof peer;
    return ::getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
           peer.uid == owner;
}

}  // namespace

bool is_sealed(int file) {
    const int found = ::fcntl(file, F_GET_SEALS);
    return found != -1 && (found & seals) == seals;
}

Expected<FileDescriptor> fetch_sealed(int socket, const std::filesystem::path& path,
                                      std::uint32_t owner) {
    const FileDescriptor connection(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    if (!connection) return not_handed(path);
    for (const int option : {SO_RCVTIMEO, SO_SNDTIMEO})
        ::setsockopt(connection.get(), SOL_SOCKET, option, &patience, sizeof patience);
    // By what was looked at, not by the name, which may be another's by now.
    const std::string name = "/proc/self/fd/" + std::to_string(socket);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, name.size());
    if (::connect(connection.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) !=
        0)
        return not_handed(path);
    if (!is_of(connection.get(), owner))
        return failure(ErrorCode::not_trusted, path.string(),
                       "is served by another user than its owner",
                       "somebody else may have put it there: remove it");
    FileDescriptor file = receive(connection.get());
    if (!file) return not_handed(path);
    if (!is_sealed(file.get()))
        return failure(ErrorCode::not_trusted, path.string(), "is not sealed, though it should be",
                       "install service and clients of the same release");
    return file;
}

}  // namespace versavis::ring
