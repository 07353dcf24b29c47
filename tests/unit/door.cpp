// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/door.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "../support/temporary_directory.hpp"
#include "client/trust.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

File sealed_file() {
    File file(::memfd_create("file", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    ::ftruncate(file.descriptor(), page_size);
    ::fcntl(file.descriptor(), F_ADD_SEALS,
            F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL);
    return file;
}

File connect(const std::filesystem::path& path) {
    File socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    ::connect(socket.descriptor(), reinterpret_cast<sockaddr*>(&address), sizeof address);
    return socket;
}

}  // namespace

TEST_CASE("door: a crowd that takes nothing, or leaves at once, stops nobody") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto path = directory.path() / "door";
    const auto door = Door::open(path, sealed_file());
    REQUIRE(door);
    std::vector<File> crowd;
    for (int i = 0; i < 200; ++i) {
        if (i % 2 == 0)
            crowd.push_back(connect(path));
        else
            connect(path);
        CHECK(open_trusted(path, std::nullopt));
    }
}

TEST_CASE("door: where an address has no room for the path, and whatever lay there") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto deep = directory.path() / std::string(150, 'd');
    std::filesystem::create_directory(deep);
    std::filesystem::create_symlink("victim", deep / "door");
    {
        const auto door = Door::open(deep / "door", sealed_file());
        REQUIRE(door);
        CHECK(open_trusted(deep / "door", std::nullopt));
        std::filesystem::rename(deep / "door", deep / "renamed");
        CHECK(open_trusted(deep / "renamed", std::nullopt));
    }
    CHECK_THAT(open_trusted(deep / "renamed", std::nullopt).error().message(),
               Catch::Contains("its service has ended"));
    CHECK_FALSE(std::filesystem::exists(deep / "victim"));
}

TEST_CASE("door: where it cannot be made, it says so") {
    CHECK_THAT(Door::open("/nowhere/door", sealed_file()).error().message(),
               Catch::Contains("cannot be made a socket: No such file or directory"));
    CHECK_THAT(Door::open("/proc/door", sealed_file()).error().message(),
               Catch::Contains("/proc/door: cannot be made a socket"));
}
