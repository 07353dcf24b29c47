// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/directory.hpp"
#include "../support/look.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"
#include "versavis/time.hpp"

using namespace versavis;
using namespace versavis::ring;

TEST_CASE("directory: one owner at a time, readable for its group, whatever the umask") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    {
        const mode_t mask = ::umask(0077);
        auto first = OwnedDirectory::claim(path);
        ::umask(mask);
        REQUIRE(first);
        struct stat info {};
        REQUIRE(stat(path.c_str(), &info) == 0);
        CHECK((info.st_mode & 0777U) == 0750U);
        CHECK_THAT(OwnedDirectory::claim(path).error().message(),
                   Catch::Contains("another versavisd") && !Catch::Contains("(process"));
    }
    CHECK(OwnedDirectory::claim(path));
}

TEST_CASE("directory: another service is found by its rings, too, and named", "[kernel]") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    int ready[2];
    REQUIRE(::pipe(ready) == 0);
    const pid_t service = ::fork();
    if (service == 0) {
        const auto directory = OwnedDirectory::claim(path);
        const auto writer = Writer::create(path, {"events", StreamKind::events, 8});
        const char ok = directory && writer ? 1 : 0;
        if (::write(ready[1], &ok, 1) != 1) ::_exit(1);
        ::pause();
        ::_exit(0);
    }
    char ok = 0;
    REQUIRE(::read(ready[0], &ok, 1) == 1);
    REQUIRE(ok == 1);
    const std::string name = "serves this instance (process " + std::to_string(service) + ")";
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains(name));
    std::filesystem::remove(path / ".lock");
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains(name));
    CHECK(std::filesystem::exists(path / "events"));
    ::kill(service, SIGKILL);
    ::waitpid(service, nullptr, 0);
    CHECK(OwnedDirectory::claim(path));
    for (const int end : ready) ::close(end);
}

namespace {

/// Updates a heartbeat by the clock of its own writer, as long as this lives.
class Heartbeat {
 public:
    explicit Heartbeat(Header& header)
        : thread_([this, &header] {
              while (!stop_) {  // it is never ahead of the clock, as no writer's is
                  std::this_thread::sleep_for(std::chrono::milliseconds(50));
                  header.heartbeat_ns.fetch_add(50'000'000);
              }
          }) {}
    ~Heartbeat() {
        stop_ = true;
        thread_.join();
    }
    Heartbeat(const Heartbeat&) = delete;
    Heartbeat& operator=(const Heartbeat&) = delete;

 private:
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

/// A directory with a ring of this process.
struct ServedDirectory {
    test::TemporaryDirectory parent{"/dev/shm"};
    std::filesystem::path path = parent.path() / "instance";
    bool claimed = OwnedDirectory::claim(path).has_value();
    Writer writer = *Writer::create(path, {"events", StreamKind::events, 8});
    Mapping segment = *Mapping::open(path / "events", Mapping::Access::read_write);
    Header& header = segment.header();
};

}  // namespace

TEST_CASE_METHOD(ServedDirectory, "directory: a service that only its heartbeat shows is found") {
    SECTION("of another pid namespace") { ++header.pid_namespace; }
    SECTION("of another time namespace, whose clock is far off") {
        ++header.time_namespace;
        header.heartbeat_ns = (host_now() - seconds(500)).ns;
    }
    {
        const Heartbeat heartbeat(header);
        CHECK_THAT(OwnedDirectory::claim(path).error().message(),
                   Catch::Contains("serves this instance (process"));
    }
    CHECK(OwnedDirectory::claim(path));  // it died a moment ago
    header.state = static_cast<std::uint32_t>(WriterState::closed);
    const HostTime begun = host_now();
    CHECK(OwnedDirectory::claim(path));
    CHECK(host_now() - begun < seconds(1));
}

TEST_CASE_METHOD(ServedDirectory, "directory: a heartbeat that stopped long ago delays nobody") {
    ++header.pid_namespace;
    header.heartbeat_ns = (host_now() - seconds(4)).ns;
    const HostTime begun = host_now();
    CHECK(OwnedDirectory::claim(path));
    CHECK(host_now() - begun < seconds(1));
}

namespace {

/// Descriptors of this process that are open now.
std::set<int> open_descriptors() {
    std::set<int> found;
    for (int file = 0; file < 1024; ++file)
        if (::fcntl(file, F_GETFD) >= 0) found.insert(file);
    return found;
}

/// Without standard input: what is opened next has its number.
class NoInput {
 public:
    NoInput() : input_(::dup(0)) { ::close(0); }
    ~NoInput() {
        ::dup2(input_, 0);
        ::close(input_);
    }
    NoInput(const NoInput&) = delete;
    NoInput& operator=(const NoInput&) = delete;

 private:
    int input_;
};

}  // namespace

TEST_CASE("directory: the lock is one file, which programs that are started do not get") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    const auto before = open_descriptors();
    {
        auto owner = OwnedDirectory::claim(path);
        REQUIRE(owner);
        const auto locked = open_descriptors();
        REQUIRE(locked.size() == before.size() + 1);
        for (const int file : locked)
            if (before.count(file) == 0) CHECK((::fcntl(file, F_GETFD) & FD_CLOEXEC) != 0);
        CHECK_FALSE(OwnedDirectory::claim(path));
        CHECK(open_descriptors() == locked);
        const OwnedDirectory moved = std::move(*owner);
        CHECK(open_descriptors() == locked);
        CHECK_FALSE(OwnedDirectory::claim(path));
    }
    CHECK(open_descriptors() == before);
}

TEST_CASE("directory: a service without standard input locks as well, and lets go") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    const NoInput closed;
    {
        auto owner = OwnedDirectory::claim(path);
        REQUIRE(owner);
        CHECK_FALSE(OwnedDirectory::claim(path));
    }
    CHECK(::fcntl(0, F_GETFD) < 0);
    CHECK(OwnedDirectory::claim(path));
}

TEST_CASE("directory: one above it that is made can be entered by all, whatever the umask") {
    test::TemporaryDirectory parent("/dev/shm");
    const mode_t mask = ::umask(0077);
    const bool claimed = OwnedDirectory::claim(parent.path() / "above" / "instance").has_value();
    ::umask(mask);
    REQUIRE(claimed);
    struct stat info {};
    REQUIRE(::stat((parent.path() / "above").c_str(), &info) == 0);
    CHECK((info.st_mode & 0777U) == 0755U);
}

TEST_CASE("directory: one that cannot be made, or not locked, says why") {
    test::TemporaryDirectory parent("/dev/shm");
    parent.write("file", "");
    CHECK_THAT(OwnedDirectory::claim(parent.path() / "file" / "instance").error().message(),
               Catch::Contains("cannot be created"));
    CHECK_THAT(OwnedDirectory::claim("/proc/instance").error().message(),
               Catch::Contains("cannot be created"));
    const auto path = parent.path() / "instance";
    REQUIRE(OwnedDirectory::claim(path));
    const auto lock = path / ".lock";
    const auto refusal = [&] { return OwnedDirectory::claim(path).error().message(); };
    std::filesystem::remove(lock);
    std::filesystem::create_directory(lock);
    CHECK_THAT(refusal(), Catch::Contains("/.lock: cannot be opened: Is a directory; remove it"));
    std::filesystem::remove(lock);
    REQUIRE(::mkfifo(lock.c_str(), 0600) == 0);
    CHECK_THAT(refusal(), Catch::Contains("/.lock: is not a file") && Catch::Contains("remove it"));
}

TEST_CASE("directory: nothing is locked or made behind a link with the lock's name") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    const auto elsewhere = parent.path() / "elsewhere";
    REQUIRE(OwnedDirectory::claim(path));
    std::filesystem::remove(path / ".lock");
    std::filesystem::create_symlink(elsewhere, path / ".lock");
    CHECK_THAT(OwnedDirectory::claim(path).error().message(),
               Catch::Contains("/.lock: is a link") && Catch::Contains("remove it"));
    CHECK_FALSE(std::filesystem::exists(elsewhere));
}

TEST_CASE("directory: another user's lock is refused, and named") {
    if (::geteuid() != 0) return;  // only root can give files away
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    REQUIRE(OwnedDirectory::claim(path));
    REQUIRE(::chown((path / ".lock").c_str(), 12345, 12345) == 0);
    CHECK_THAT(OwnedDirectory::claim(path).error().message(),
               Catch::Contains("/.lock: belongs to another user (uid 12345); remove it"));
}

TEST_CASE("directory: whom readers shall believe does not keep its owner out") {
    test::TemporaryDirectory parent("/dev/shm");
    ::setenv("VERSAVIS_OWNER", "nobody", 1);
    const bool claimed = OwnedDirectory::claim(parent.path() / "instance").has_value();
    ::unsetenv("VERSAVIS_OWNER");
    CHECK(claimed);
}

TEST_CASE("directory: a ring that names no process is nobody's") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    REQUIRE(OwnedDirectory::claim(path));
    const auto writer = Writer::create(path, {"events", StreamKind::events, 8});
    REQUIRE(writer);
    CHECK(OwnedDirectory::claim(path));  // it is our own
    const auto segment = Mapping::open(path / "events", Mapping::Access::read_write);
    segment->header().writer_pid = 0x7FFFFFF0;
    segment->header().writer_start_ticks = 0;
    CHECK(OwnedDirectory::claim(path));
}

TEST_CASE("directory: segments of a dead owner are retired, our own are kept") {
    test::TemporaryDirectory parent("/dev/shm");
    auto directory = OwnedDirectory::claim(parent.path() / "instance");
    REQUIRE(directory);
    auto own = Writer::create(directory->path(), {"own", StreamKind::events, 8});
    REQUIRE(own);
    // A copy is a segment whose writer never closed it; another process id makes it a stranger's.
    const auto stranger = directory->path() / "stranger";
    std::filesystem::copy_file(directory->path() / "own", stranger);
    {
        std::fstream file(stranger, std::ios::in | std::ios::out | std::ios::binary);
        const std::uint32_t pid = 1;
        file.seekp(offsetof(Header, writer_pid))
            .write(reinterpret_cast<const char*>(&pid), sizeof pid);
    }
    auto reader = Reader::open(stranger);
    REQUIRE(reader);
    const auto segment = Mapping::open(stranger, Mapping::Access::read_only);
    REQUIRE(segment);
    std::filesystem::copy_file(stranger, directory->path() / "kept");
    directory->remove_stale({"kept"});
    CHECK(std::filesystem::exists(directory->path() / "kept"));
    CHECK(std::filesystem::exists(directory->path() / "own"));
    CHECK_FALSE(std::filesystem::exists(stranger));
    CHECK(test::look(reader->next()).found == test::Found::gone);
    CHECK(segment->header().state == static_cast<std::uint32_t>(WriterState::closed));
    CHECK(segment->header().wake == 1);
}

TEST_CASE("directory: what is no ring there holds nobody up") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    REQUIRE(OwnedDirectory::claim(path));
    REQUIRE(::mkfifo((path / "pipe").c_str(), 0600) == 0);
    std::filesystem::create_symlink("nothing", path / "link");
    std::filesystem::create_directory(path / "directory");
    const auto writer = Writer::create(path, {"own", StreamKind::events, 8});
    const auto directory = OwnedDirectory::claim(path);
    REQUIRE(directory);
    directory->remove_stale({});
    CHECK(std::filesystem::exists(path / "own"));
    CHECK_FALSE(OwnedDirectory::claim(path));
}

TEST_CASE("directory: one that others may write to is refused, with the cure") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    REQUIRE(::mkdir(path.c_str(), 0700) == 0);
    for (const mode_t mode : {0777U, 0770U, 01777U}) {
        REQUIRE(::chmod(path.c_str(), mode) == 0);
        CHECK_THAT(OwnedDirectory::claim(path).error().message(),
                   Catch::Contains("can be written by others") && Catch::Contains("chmod 0750"));
    }
    REQUIRE(::chmod(path.c_str(), 0750) == 0);
    CHECK(OwnedDirectory::claim(path));
    REQUIRE(::chmod(parent.path().c_str(), 0777) == 0);
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains("chmod 0755"));
}

TEST_CASE("directory: a link or another's directory is refused") {
    test::TemporaryDirectory parent("/dev/shm");
    const auto path = parent.path() / "instance";
    std::filesystem::create_directory_symlink(parent.path(), path);
    CHECK_THAT(OwnedDirectory::claim(path).error().message(), Catch::Contains("not a directory"));
    const std::filesystem::path foreign = ::geteuid() == 0 ? parent.path() / "foreign" : "/proc";
    if (::geteuid() == 0) {
        REQUIRE(::mkdir(foreign.c_str(), 0750) == 0);
        REQUIRE(::chown(foreign.c_str(), 12345, 12345) == 0);
    }
    CHECK_THAT(OwnedDirectory::claim(foreign).error().message(), Catch::Contains("another user"));
    if (::geteuid() != 0) return;
    REQUIRE(::chown(foreign.c_str(), 0, 0) == 0);
    REQUIRE(::chown(parent.path().c_str(), 12345, 12345) == 0);
    CHECK_THAT(OwnedDirectory::claim(foreign).error().message(),
               Catch::Contains("who could put another directory in its place"));
}

TEST_CASE("directory: whose the one above it may be") {
    if (::geteuid() != 0) return;  // only root can become somebody else
    constexpr uid_t nobody = 65534;
    constexpr uid_t stranger = 12345;
    struct Case {
        uid_t above;
        uid_t service;
        const char* believed;  ///< VERSAVIS_OWNER
        bool claimed;
    };
    for (const Case& one :
         {Case{0, stranger, "nobody", true}, Case{stranger, stranger, "nobody", true},
          Case{nobody, 0, "nobody", true}, Case{nobody, stranger, "nobody", true},
          Case{nobody, 0, "", false}, Case{nobody, stranger, "", false}}) {
        CAPTURE(one.above, one.service, one.believed);
        test::TemporaryDirectory parent("/dev/shm");
        const auto path = parent.path() / "instance";
        REQUIRE(::mkdir(path.c_str(), 0750) == 0);
        REQUIRE(::chown(path.c_str(), one.service, one.service) == 0);
        REQUIRE(::chmod(parent.path().c_str(), 0755) == 0);
        REQUIRE(::chown(parent.path().c_str(), one.above, one.above) == 0);
        CHECK(one.claimed == test::in_process([&] {
                  ::setenv("VERSAVIS_OWNER", one.believed, 1);
                  return ::seteuid(one.service) == 0 && OwnedDirectory::claim(path);
              }));
    }
}
