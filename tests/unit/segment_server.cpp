// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/segment_server.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <string>
#include <vector>

#include "../support/shortage.hpp"
#include "../support/temporary_directory.hpp"
#include "../support/threads.hpp"
#include "client/trust.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

FileDescriptor sealed_file() {
    FileDescriptor file(::memfd_create("file", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    ::ftruncate(file.get(), page_size);
    ::fcntl(file.get(), F_ADD_SEALS,
            F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL);
    return file;
}

FileDescriptor make_socket() {
    return FileDescriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

bool connects(const FileDescriptor& socket, const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    return ::connect(socket.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
}

FileDescriptor connect_client(const std::filesystem::path& path) {
    FileDescriptor socket = make_socket();
    connects(socket, path);
    return socket;
}

/// It gets one byte, and with it a descriptor of that file, and then nothing more.
bool is_handed(const FileDescriptor& socket, const FileDescriptor& file) {
    pollfd any{socket.get(), POLLIN, 0};
    ::poll(&any, 1, -1);
    std::array<char, 2> bytes{};
    iovec data{bytes.data(), bytes.size()};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> room{};
    msghdr message{};
    message.msg_iov = &data;
    message.msg_iovlen = 1;
    message.msg_control = room.data();
    message.msg_controllen = room.size();
    const auto size = ::recvmsg(socket.get(), &message, MSG_CMSG_CLOEXEC);
    const cmsghdr* rights = CMSG_FIRSTHDR(&message);
    if (size != 1 || rights == nullptr || rights->cmsg_len != CMSG_LEN(sizeof(int))) return false;
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(rights), sizeof descriptor);
    const FileDescriptor handed(descriptor);
    struct stat one {};
    struct stat other {};
    ::poll(&any, 1, -1);
    return ::fstat(handed.get(), &one) == 0 && ::fstat(file.get(), &other) == 0 &&
           one.st_ino == other.st_ino && ::recv(socket.get(), bytes.data(), 1, 0) == 0;
}

}  // namespace

TEST_CASE("segment_server: a socket is deserted once its server has ended") {
    const test::TemporaryDirectory directory;
    const auto path = directory.path() / "stream";
    CHECK_FALSE(SegmentServer::is_deserted(path));
    {
        const auto server = SegmentServer::open(path, sealed_file());
        REQUIRE(server);
        CHECK_FALSE(SegmentServer::is_deserted(path));
    }
    CHECK(SegmentServer::is_deserted(path));
    std::filesystem::create_symlink("stream", directory.path() / "link");
    CHECK_FALSE(SegmentServer::is_deserted(directory.path() / "link"));
    std::filesystem::remove(path);
    directory.write("stream", "");
    CHECK_FALSE(SegmentServer::is_deserted(path));
}

TEST_CASE("segment_server: a crowd that takes nothing, or leaves at once, stops nobody") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto path = directory.path() / "server";
    const auto server = SegmentServer::open(path, sealed_file());
    REQUIRE(server);
    std::vector<FileDescriptor> crowd;
    for (int i = 0; i < 200; ++i) {
        if (i % 2 == 0)
            crowd.push_back(connect_client(path));
        else
            connect_client(path);
        CHECK(open_trusted(path, std::nullopt));
    }
}

TEST_CASE(
    "segment_server: who connects gets one byte with the file, without a word, and is "
    "disconnected") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto path = directory.path() / "server";
    const FileDescriptor file = sealed_file();
    const auto server = SegmentServer::open(path, FileDescriptor(::dup(file.get())));
    REQUIRE(server);
    CHECK(is_handed(connect_client(path), file));
}

TEST_CASE("segment_server: without a descriptor to be had it rests, and lets all in later") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto path = directory.path() / "server";
    const FileDescriptor file = sealed_file();
    const auto others = test::threads();
    const auto server = SegmentServer::open(path, FileDescriptor(::dup(file.get())));
    REQUIRE(server);
    test::Rest rest(test::wait_for_one_more(others));
    rest.wait();
    std::vector<FileDescriptor> crowd;
    for (int i = 0; i < 50; ++i) crowd.push_back(make_socket());
    {
        const test::NoDescriptors none;
        // The first has the descriptor at which the server has been waiting for somebody.
        for (const FileDescriptor& socket : crowd) CHECK(connects(socket, path));
        rest.wait();
    }
    for (const FileDescriptor& socket : crowd) CHECK(is_handed(socket, file));
}

TEST_CASE("segment_server: where an address has no room for the path, and whatever lay there") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto deep = directory.path() / std::string(150, 'd');
    std::filesystem::create_directory(deep);
    std::filesystem::create_symlink("victim", deep / "server");
    {
        const auto server = SegmentServer::open(deep / "server", sealed_file());
        REQUIRE(server);
        CHECK(open_trusted(deep / "server", std::nullopt));
        std::filesystem::rename(deep / "server", deep / "renamed");
        CHECK(open_trusted(deep / "renamed", std::nullopt));
    }
    CHECK_THAT(open_trusted(deep / "renamed", std::nullopt).error().message(),
               Catch::Contains("its service has died"));
    CHECK_FALSE(std::filesystem::exists(deep / "victim"));
}

TEST_CASE("segment_server: where it cannot be made, it says so") {
    CHECK_THAT(SegmentServer::open("/nowhere/server", sealed_file()).error().message(),
               Catch::Contains("cannot be made a socket: No such file or directory"));
    CHECK_THAT(SegmentServer::open("/proc/server", sealed_file()).error().message(),
               Catch::Contains("/proc/server: cannot be made a socket"));
    const std::string longest(300, 'x');
    CHECK_THAT(SegmentServer::open("/" + longest + "/server", sealed_file()).error().message(),
               Catch::Contains("cannot be made a socket: File name too long"));
    const test::TemporaryDirectory directory("/dev/shm");
    const auto pipe = directory.path() / "pipe";
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    CHECK_THAT(SegmentServer::open(pipe / "server", sealed_file()).error().message(),
               Catch::Contains("cannot be made a socket: Not a directory"));
    const test::NoThreads none;
    CHECK_THAT(
        SegmentServer::open(directory.path() / "server", sealed_file()).error().message(),
        Catch::Contains("cannot start a thread") && Catch::Contains("raise the limit on tasks"));
}
