// SPDX-License-Identifier: BSD-3-Clause
#include "client/sealed.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/look.hpp"
#include "../support/temporary_directory.hpp"
#include "client/trust.hpp"
#include "engine/ring/directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::Found;
using test::in_process;

namespace {

constexpr uid_t other_user = 12345;

struct SealedInstance {
    test::TemporaryDirectory directory{"/dev/shm"};

    std::filesystem::path path() const { return directory.path() / "frames"; }
    Writer write(bool sealed = true) const {
        return *Writer::create({directory.path(), sealed},
                               {"frames", StreamKind::frames, 8, 4, page_size});
    }
    std::string refusal(const Options& options = {}) const {
        const auto reader = Reader::open(path(), options);
        return reader ? "" : reader.error().message();
    }
};

void publish_page(Writer& writer, int value) {
    const auto slot = *writer.acquire();
    std::memset(writer.slot_data(slot), value, page_size);
    writer.publish(slot, page_size, OutputTime{value}, {});
}

/// Reads on where the memory is gone.
bool dies_of_sigbus(const std::function<void()>& body) {
    return in_process([&] {
        std::signal(SIGBUS, [](int) { ::_exit(0); });
        body();
        return false;
    });
}

/// Somebody who listens under the stream's name, and does something with whoever connects.
class Peer {
 public:
    Peer(const std::filesystem::path& path, std::function<void(int)> answer)
        : socket_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        path.string().copy(address.sun_path, sizeof address.sun_path - 1);
        REQUIRE(::bind(socket_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
        REQUIRE(::listen(socket_.get(), 4) == 0);
        thread_ = std::thread([this, answer = std::move(answer)] {
            const FileDescriptor connection(
                ::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
            if (!connection) return;
            answer(connection.get());
            char byte = 0;
            ::recv(connection.get(), &byte, 1, 0);  // until the other one has left
        });
    }
    ~Peer() {
        ::shutdown(socket_.get(), SHUT_RDWR);
        thread_.join();
    }

 private:
    FileDescriptor socket_;
    std::thread thread_;
};

void send(int connection, const std::vector<int>& files) {
    char byte = 0;
    iovec data{&byte, 1};
    alignas(cmsghdr) char room[CMSG_SPACE(4 * sizeof(int))]{};
    msghdr message{};
    message.msg_iov = &data;
    message.msg_iovlen = 1;
    if (!files.empty()) {
        message.msg_control = room;
        message.msg_controllen = CMSG_SPACE(files.size() * sizeof(int));
        cmsghdr* rights = CMSG_FIRSTHDR(&message);
        rights->cmsg_level = SOL_SOCKET;
        rights->cmsg_type = SCM_RIGHTS;
        rights->cmsg_len = CMSG_LEN(files.size() * sizeof(int));
        std::memcpy(CMSG_DATA(rights), files.data(), files.size() * sizeof(int));
    }
    ::sendmsg(connection, &message, MSG_NOSIGNAL);
}

std::ptrdiff_t open_file_count() {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return std::distance(begin(files), end(files));
}

}  // namespace

TEST_CASE_METHOD(SealedInstance, "sealed: read as any other stream, by its name") {
    const auto before = open_file_count();
    {
        Writer writer = write();
        struct stat name {};
        REQUIRE(::lstat(path().c_str(), &name) == 0);
        CHECK(S_ISSOCK(name.st_mode));
        CHECK((name.st_mode & 0777) == 0660);
        Options only;
        only.sealed_only = true;
        auto reader = Reader::open(path(), only);
        REQUIRE(reader);
        CHECK(reader->writer_alive());
        publish_page(writer, 7);
        const auto item = test::look(reader->next());
        REQUIRE(item.found == Found::item);
        CHECK(item.payload.data()[page_size - 1] == std::byte{7});
        CHECK(item.valid());
    }
    CHECK(std::filesystem::is_empty(directory.path()));
    CHECK(open_file_count() == before);
}

TEST_CASE_METHOD(SealedInstance, "sealed: nobody cuts it short or writes to it, as whoever") {
    Writer writer = write();
    const auto handed = open_trusted(path(), std::nullopt);
    REQUIRE(handed);
    const int file = handed->file.get();
    CHECK(is_sealed(file));
    const std::string own = "/proc/self/fd/" + std::to_string(file);
    const FileDescriptor again(::open(own.c_str(), O_RDWR | O_CLOEXEC));
    for (const int any : {file, again.get()}) {
        CHECK(::ftruncate(any, 0) != 0);
        CHECK(::ftruncate(any, 1 << 20) != 0);
        CHECK(::pwrite(any, "x", 1, 0) != 1);
        CHECK(::fallocate(any, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, page_size) != 0);
        CHECK(::fcntl(any, F_ADD_SEALS, F_SEAL_WRITE) != 0);
        CHECK(::mmap(nullptr, page_size, PROT_READ | PROT_WRITE, MAP_SHARED, any, 0) == MAP_FAILED);
    }
}

TEST_CASE("sealed: only with each of the four seals, and only what can have them") {
    const int missing = GENERATE(0, F_SEAL_SEAL, F_SEAL_SHRINK, F_SEAL_GROW, F_SEAL_FUTURE_WRITE);
    const int all = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE;
    const FileDescriptor file(::memfd_create("file", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    REQUIRE(::fcntl(file.get(), F_ADD_SEALS, all & ~missing) == 0);
    CHECK(is_sealed(file.get()) == (missing == 0));
    const FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    CHECK_FALSE(is_sealed(socket.get()));
}

TEST_CASE_METHOD(SealedInstance, "sealed: one that is not can be cut short under its readers") {
    Writer writer = write(false);
    publish_page(writer, 7);
    CHECK(dies_of_sigbus([&] {
        auto reader = Reader::open(path(), {Position::oldest});
        static_cast<void>(::truncate(path().c_str(), page_size));
        static_cast<void>(reader->next());
    }));
}

TEST_CASE_METHOD(SealedInstance,
                 "sealed: who wants nothing else is refused what is not, with the reason") {
    const Writer writer = write(false);
    Options only;
    only.sealed_only = true;
    CHECK(refusal().empty());
    CHECK_THAT(refusal(only), Catch::Contains("is not sealed; set 'sealed = true'"));
}

TEST_CASE_METHOD(SealedInstance, "sealed: readers follow to whatever takes its name") {
    const bool to_sealed = GENERATE(true, false);
    const bool from_sealed = GENERATE(true, false);
    CAPTURE(from_sealed, to_sealed);
    Writer writer = write(from_sealed);
    auto reader = Reader::open(path(), {Position::oldest});
    REQUIRE(reader);
    publish_page(writer, 1);
    {
        Writer next = write(to_sealed);
        writer = std::move(next);
    }
    publish_page(writer, 2);
    CHECK(test::look(reader->next()).time.ns == 1);
    CHECK(test::look(reader->next()).found == Found::restarted);
    CHECK(test::look(reader->next()).time.ns == 2);
}

TEST_CASE_METHOD(SealedInstance,
                 "sealed: of a service that was killed, the name is known for dead") {
    REQUIRE(in_process([&]() -> bool {
        const auto owned = OwnedDirectory::claim(directory.path() / "instance");
        auto writer = Writer::create({owned->path(), true}, {"frames", StreamKind::events, 8});
        ::_exit(writer ? 0 : 1);
    }));
    const auto name = directory.path() / "instance" / "frames";
    REQUIRE(std::filesystem::is_socket(name));
    CHECK_THAT(Reader::open(name).error().message(), Catch::Contains("its service has died"));
    const auto owned = OwnedDirectory::claim(directory.path() / "instance");
    REQUIRE(owned);
    const auto own = Writer::create({owned->path(), true}, {"own", StreamKind::events, 8});
    owned->remove_stale({});
    CHECK_FALSE(std::filesystem::exists(name));
    CHECK(Reader::open(owned->path() / "own"));
}

TEST_CASE_METHOD(SealedInstance,
                 "sealed: what a liar hands over is refused, and nothing of it kept", "[kernel]") {
    directory.write("file", std::string(page_size, 'x'));
    const FileDescriptor plain(::open((directory.path() / "file").c_str(), O_RDONLY | O_CLOEXEC));
    const FileDescriptor soft(::memfd_create("soft", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    const auto before = open_file_count();
    const auto refusal_of = [&](const std::function<void(int)>& answer) {
        const Peer peer(path(), answer);
        std::string message = refusal();
        std::filesystem::remove(path());
        return message;
    };
    // It is waited for, and that a second at most.
    CHECK_THAT(refusal_of([](int) {}),
               Catch::Contains("handed over by the service: Resource temp"));
    CHECK_THAT(refusal_of([](int connection) { ::shutdown(connection, SHUT_RDWR); }),
               Catch::Contains("handed over by the service: Protocol error"));
    CHECK_THAT(refusal_of([](int connection) { send(connection, {}); }),
               Catch::Contains("handed over by the service: Protocol error"));
    for (const std::vector<int>& files : {std::vector<int>{plain.get()}, {soft.get()}, {0, 1, 2}})
        CHECK_THAT(refusal_of([&](int connection) { send(connection, files); }),
                   Catch::Contains("is not sealed, though it should be"));
    CHECK(open_file_count() == before);
    REQUIRE(::fcntl(soft.get(), F_ADD_SEALS,
                    F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) == 0);
    CHECK_THAT(refusal_of([&](int connection) { send(connection, {soft.get()}); }),
               Catch::Contains("frames"));  // empty: it cannot be mapped
}

TEST_CASE_METHOD(SealedInstance,
                 "sealed: where no descriptor is left to connect, that is what is reported") {
    const Writer writer = write();
    CHECK(in_process([&] {
        const rlimit few{64, 64};
        if (::setrlimit(RLIMIT_NOFILE, &few) != 0) return false;
        std::vector<FileDescriptor> files;
        for (int file = ::dup(0); file >= 0; file = ::dup(0)) files.emplace_back(file);
        files.pop_back();  // for the directory
        files.pop_back();  // and what has the name in it
        return refusal().find("the service: Too many open files") != std::string::npos;
    }));
}

TEST_CASE_METHOD(SealedInstance,
                 "sealed: served by another user than its owner, or to another group") {
    if (::geteuid() != 0) return;  // only root can become somebody else
    REQUIRE(::chmod(directory.path().c_str(), 0755) == 0);
    {
        const Writer writer = write();
        CHECK(in_process([&] {
            return ::setegid(other_user) == 0 && ::seteuid(other_user) == 0 &&
                   refusal().find("permission denied; join the group") != std::string::npos;
        }));
        REQUIRE(::chmod(path().c_str(), 0664) == 0);  // who may look at it may not connect
        CHECK(in_process([&] {
            return ::setegid(other_user) == 0 && ::seteuid(other_user) == 0 &&
                   refusal().find("permission denied; join the group") != std::string::npos;
        }));
        REQUIRE(::chown(path().c_str(), other_user, other_user) == 0);
        CHECK_THAT(refusal(), Catch::Contains("does not belong"));
    }
    const FileDescriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path().string().copy(address.sun_path, sizeof address.sun_path - 1);
    std::filesystem::remove(path());
    REQUIRE(::bind(socket.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
    REQUIRE(in_process([&] {  // who listens is known by the socket from then on
        return ::seteuid(other_user) == 0 && ::listen(socket.get(), 4) == 0;
    }));
    CHECK_THAT(refusal(), Catch::Contains("is served by another user"));
}
