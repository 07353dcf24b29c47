// SPDX-License-Identifier: BSD-3-Clause
#include "client/process.hpp"

#include <sched.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <thread>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::in_process;

#ifndef CLONE_NEWTIME  // glibc 2.35 does not know it yet
#define CLONE_NEWTIME 0x80
#endif

namespace {

Constants own_constants() {
    Constants constants{};
    constants.writer_pid = static_cast<std::uint32_t>(::getpid());
    constants.writer_start_ticks = start_ticks_of_this_process();
    constants.pid_namespace = own_namespaces().pid;
    constants.time_namespace = own_namespaces().time;
    return constants;
}

}  // namespace

TEST_CASE("process: another one, or an earlier one with its number, did not make it") {
    CHECK(is_own(own_constants()));
    Constants constants = own_constants();
    constants.writer_pid = 1;
    CHECK_FALSE(is_own(constants));
    constants = own_constants();
    constants.writer_start_ticks = start_ticks_of(1);
    CHECK_FALSE(is_own(constants));
    constants = own_constants();
    ++constants.pid_namespace;
    CHECK_FALSE(is_own(constants));
    constants = own_constants();
    ++constants.time_namespace;
    CHECK_FALSE(is_own(constants));
}

TEST_CASE("process: it is there, dead, or cannot be judged from here") {
    struct stat file {};
    REQUIRE(::stat("/proc/self/ns/pid", &file) == 0);
    CHECK(own_namespaces().pid == file.st_ino);
    CHECK(liveness(own_constants()) == Liveness::alive);
    Constants later = own_constants();
    ++later.writer_start_ticks;
    CHECK(quick_liveness(later) == Liveness::alive);
    CHECK(liveness(later) == Liveness::dead);
    Constants none = own_constants();
    none.writer_pid = 0x7FFFFFFF;
    CHECK(quick_liveness(none) == Liveness::dead);
    CHECK(liveness(none) == Liveness::dead);
    for (const std::uint32_t odd : {0U, 0x80000000U, 0xFFFFFFFFU}) {
        none.writer_pid = odd;
        CHECK(quick_liveness(none) == Liveness::unknown);
        CHECK(liveness(none) == Liveness::unknown);
    }
    none.writer_pid = 1;  // as a service in a container
    CHECK(quick_liveness(none) == Liveness::alive);
    errno = ESRCH;  // of an earlier call
    CHECK(quick_liveness(later) == Liveness::alive);
    for (const std::uint64_t space : {std::uint64_t{0}, own_namespaces().pid + 1}) {
        Constants elsewhere = later;
        elsewhere.pid_namespace = space;
        CHECK(quick_liveness(elsewhere) == Liveness::unknown);
        CHECK(liveness(elsewhere) == Liveness::unknown);
    }
}

TEST_CASE("process: its start says nothing in another time namespace") {
    for (const std::uint64_t space : {std::uint64_t{0}, own_namespaces().time + 1}) {
        Constants elsewhere = own_constants();
        elsewhere.time_namespace = space;
        CHECK(liveness(elsewhere) == Liveness::unknown);
        ++elsewhere.writer_start_ticks;
        CHECK(quick_liveness(elsewhere) == Liveness::alive);
        CHECK(liveness(elsewhere) == Liveness::unknown);
        elsewhere.writer_pid = 0x7FFFFFFF;
        CHECK(liveness(elsewhere) == Liveness::dead);
    }
}

namespace {

/// The children of this process live 1000 s later from then on.
bool shift_children_in_time() {
    return ::unshare(CLONE_NEWTIME) == 0 &&
           static_cast<bool>(std::ofstream("/proc/self/timens_offsets")
                             << "monotonic 1000 0\nboottime 1000 0\n"
                             << std::flush);
}

/// What a reader in another time namespace makes of a writer that only its heart shows to live.
bool lives_across_time(const std::filesystem::path& path) {
    const auto mapping = Mapping::open(path, Mapping::Access::read_write);
    if (!mapping) return false;
    const Constants& constants = mapping->constants();
    ring::Pulse pulse;
    writer_lives(*mapping, pulse);
    mapping->header().heartbeat_ns.fetch_add(1);
    return own_namespaces().time != constants.time_namespace &&
           start_ticks_of(constants.writer_pid) != constants.writer_start_ticks &&
           liveness(constants) == Liveness::unknown && writer_lives(*mapping, pulse);
}

}  // namespace

TEST_CASE("process: a writer lives on for readers in another time namespace") {
    if (!in_process(shift_children_in_time)) {
        WARN("not tested: this machine lets nobody make a time namespace");
        return;
    }
    const test::TemporaryDirectory directory("/dev/shm");
    const auto writer = *Writer::create(directory.path(), {"events", StreamKind::events, 8});
    CHECK(in_process([&] {
        return shift_children_in_time() &&
               in_process([&] { return lives_across_time(directory.path() / "events"); });
    }));
}

TEST_CASE("process: one that may not be asked is there, and one that cannot be seen is unknown",
          "[kernel]") {
    if (::geteuid() != 0) return;  // only root can become somebody else, or see another /proc
    const Constants own = own_constants();
    CHECK(in_process(
        [&] { return ::seteuid(12345) == 0 && quick_liveness(own) == Liveness::alive; }));
    const test::TemporaryDirectory empty;
    CHECK(in_process([&] {
        const Constants seen = own_constants();
        return ::chroot(empty.path().c_str()) == 0 && liveness(seen) == Liveness::unknown;
    }));
    CHECK(in_process([&] {
        if (::chroot(empty.path().c_str()) != 0 || own_namespaces().pid != 0) return false;
        Constants unknown = own;
        unknown.pid_namespace = 0;  // as unknown as one's own
        return quick_liveness(unknown) == Liveness::unknown;
    }));
}

TEST_CASE("process: the first one of a container knows its namespace, too") {
    if (::geteuid() != 0) return;  // only root can make one
    const std::uint64_t outside = own_namespaces().pid;
    CHECK(in_process([&] {
        if (::unshare(CLONE_NEWPID) != 0) return true;  // nor may root everywhere
        return in_process([&] {
            std::uint64_t inside = 0;
            std::thread([&] { inside = own_namespaces().pid; }).join();
            return ::getpid() == 1 && inside != 0 && inside != outside;
        });
    }));
}

TEST_CASE("process: a writer lives whose stream is open and whose heart beats, unless it is dead") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto writer = *Writer::create(directory.path(), {"events", StreamKind::events, 8});
    const auto path = directory.path() / "events";
    auto mapping = *Mapping::open(path, Mapping::Access::read_write);
    Header& header = mapping.header();
    {
        ring::Pulse pulse;
        CHECK(writer_lives(mapping, pulse));
    }
    ++header.writer_start_ticks;  // an earlier process had its number
    mapping.read_constants();
    {
        // Its heart beats on another clock, so it is only asked for by its number.
        const HostTime ahead = host_now() + seconds(500);
        ring::Pulse pulse;
        header.heartbeat_ns = ahead.ns;
        CHECK_FALSE(writer_lives(mapping, pulse));
        header.heartbeat_ns = ahead.ns + 1;
        CHECK(writer_lives(mapping, pulse));
        header.state = static_cast<std::uint32_t>(WriterState::closed);
        CHECK_FALSE(writer_lives(mapping, pulse));
    }
    header.state = static_cast<std::uint32_t>(WriterState::live);
    header.heartbeat_ns = (host_now() - milliseconds(150)).ns;
    ring::Pulse pulse;
    CHECK_FALSE(writer_lives(mapping, pulse));
}

TEST_CASE("process: a heart beats while its last beat is young") {
    ring::Pulse pulse;
    const HostTime now{1'000'000'000'000};
    CHECK(pulse.beats(now, now));
    CHECK(pulse.beats(now, now + milliseconds(2999)));
    CHECK_FALSE(pulse.beats(now, now + seconds(3)));
    CHECK(pulse.beats(now + seconds(3), now + seconds(3)));
}

TEST_CASE("process: a heart on another clock beats while it changes") {
    const HostTime now{1'000'000'000'000};
    for (const Duration off : {seconds(500), seconds(-500)}) {
        ring::Pulse pulse;
        CHECK_FALSE(pulse.beats(now + off, now));
        CHECK_FALSE(pulse.beats(now + off, now + milliseconds(20)));
        CHECK(pulse.beats(now + off + milliseconds(50), now + milliseconds(60)));
        CHECK(pulse.beats(now + off + milliseconds(50), now + milliseconds(3059)));
        CHECK_FALSE(pulse.beats(now + off + milliseconds(50), now + milliseconds(3060)));
    }
    for (const std::int64_t beat : {INT64_MIN, INT64_MAX}) {
        ring::Pulse pulse;
        CHECK_FALSE(pulse.beats({beat}, now));
        CHECK_FALSE(pulse.beats({beat}, now));
    }
}

TEST_CASE("process: the start of a process, whatever its name") {
    const std::uint64_t own = start_ticks_of_this_process();
    CHECK(own > 0);
    CHECK(start_ticks_of(static_cast<std::uint32_t>(::getppid())) <= own);
    CHECK(start_ticks_of(0x7FFFFFFF) == 0);
    CHECK(start_ticks_of(0) == 0);
    for (const char* name : {"plain", "two words", "a) R 1 2 (b", ")) Z (", ""}) {
        const std::uint64_t before = start_ticks_of_this_process();
        CHECK(in_process([&] {
            ::prctl(PR_SET_NAME, name);
            const std::uint64_t ticks = start_ticks_of_this_process();
            return ticks >= before && ticks < before + 100'000'000;
        }));
    }
    CHECK(start_ticks_of_this_process() == own);
}

TEST_CASE("process: a process that has ended is none, though its remains are there") {
    std::array<int, 2> gate{};
    REQUIRE(::pipe(gate.data()) == 0);
    const pid_t child = ::fork();
    if (child == 0) {
        char byte = 0;
        ::_exit(static_cast<int>(::read(gate[0], &byte, 1)) - 1);
    }
    CHECK(start_ticks_of(static_cast<std::uint32_t>(child)) >= start_ticks_of_this_process());
    REQUIRE(::write(gate[1], "x", 1) == 1);
    siginfo_t ended{};
    REQUIRE(::waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOWAIT) == 0);
    CHECK(start_ticks_of(static_cast<std::uint32_t>(child)) == 0);
    Constants remains = own_constants();
    remains.writer_pid = static_cast<std::uint32_t>(child);
    ++remains.time_namespace;
    CHECK(liveness(remains) == Liveness::dead);
    ::waitpid(child, nullptr, 0);
    CHECK(start_ticks_of(static_cast<std::uint32_t>(child)) == 0);
    ::close(gate[0]);
    ::close(gate[1]);
}
