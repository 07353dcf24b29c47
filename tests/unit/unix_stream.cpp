// SPDX-License-Identifier: BSD-3-Clause
#include "board/unix_stream.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <future>
#include <vector>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// A board's process that listens and accepts nobody by itself.
class SocketListener {
 public:
    explicit SocketListener(const std::string& path) {
        sockaddr_un self{};
        self.sun_family = AF_UNIX;
        std::memcpy(self.sun_path, path.c_str(), path.size() + 1);
        REQUIRE(::bind(socket_, reinterpret_cast<const sockaddr*>(&self), sizeof self) == 0);
        REQUIRE(::listen(socket_, 0) == 0);
    }
    ~SocketListener() { ::close(socket_); }
    SocketListener(const SocketListener&) = delete;
    SocketListener& operator=(const SocketListener&) = delete;

    int accept() const { return ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC); }

 private:
    int socket_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
};

}  // namespace

TEST_CASE("unix_stream: a board whose queue is full is refused at once, with what to do") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "board";
    auto listener = std::make_unique<SocketListener>(path);
    std::vector<std::unique_ptr<ByteStream>> waiting;
    auto refused = std::async(std::launch::async, [&] {
        for (;;) {
            auto stream = open_unix_stream(path);
            if (!stream) return stream.error();
            waiting.push_back(std::move(*stream));
        }
    });
    const bool at_once = refused.wait_for(std::chrono::seconds(5)) == std::future_status::ready;
    listener.reset();  // whoever waits is woken
    CHECK(at_once);
    CHECK_THAT(refused.get().message(), Catch::Contains("does not accept"));
}

TEST_CASE("unix_stream: bytes go both ways, and the end is an error") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "board";
    const SocketListener listener(path);
    auto stream = open_unix_stream(path);
    REQUIRE(stream);
    const int board = listener.accept();
    REQUIRE(::write(board, "ab", 2) == 2);
    std::array<std::uint8_t, largest_chunk> buffer{};
    const HostTime before = host_now();
    const auto chunk = (*stream)->read(buffer, seconds(5));
    REQUIRE(chunk);
    CHECK(chunk->size == 2);
    CHECK(buffer[1] == 'b');
    CHECK(chunk->received >= before);
    CHECK(chunk->received <= host_now());
    CHECK((*stream)->read(buffer, milliseconds(1))->size == 0);
    const std::array<std::uint8_t, 3> message{1, 2, 3};
    REQUIRE((*stream)->write(message));
    CHECK(::read(board, buffer.data(), buffer.size()) == 3);
    ::close(board);
    CHECK_FALSE((*stream)->read(buffer, seconds(5)));
}
