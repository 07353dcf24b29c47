// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/wait_set.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include "../support/in_process.hpp"
#include "../support/sleep.hpp"
#include "../support/temporary_directory.hpp"
#include "../support/threads.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct WaitStreams {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer writer(const std::string& name) const {
        return *Writer::create(directory.path(), {name, StreamKind::events, 8});
    }
    Reader reader(const std::string& name) const {
        auto opened = Reader::open(directory.path() / name);
        REQUIRE(opened);
        return std::move(*opened);
    }
    Mapping map(const std::string& name) const {
        return *Mapping::open(directory.path() / name, Mapping::Access::read_only);
    }
};

struct TwoStreams : WaitStreams {
    Writer a = writer("a");
    Writer b = writer("b");
    Reader of_a = reader("a");
    Reader of_b = reader("b");
    WaitSet set;

    TwoStreams() {
        REQUIRE(set.add(of_a));
        REQUIRE(set.add(of_b));
    }
};

bool readable(int descriptor, int timeout_ms = 0) {
    pollfd entry{descriptor, POLLIN, 0};
    return ::poll(&entry, 1, timeout_ms) == 1 && entry.revents == POLLIN;
}

}  // namespace

TEST_CASE_METHOD(TwoStreams, "wait_set: it names who has something, and takes turns") {
    CHECK_FALSE(set.wait({}));
    CHECK_FALSE(set.wait(milliseconds(1)));
    b.publish({}, {});
    CHECK(set.wait(seconds(20)) == 1U);
    CHECK(set.wait(seconds(20)) == 1U);  // it has not been read
    CHECK(of_b.next());
    CHECK_FALSE(set.wait({}));
    for (int i = 0; i < 3; ++i) {
        a.publish({}, {});
        b.publish({}, {});
    }
    std::set<std::size_t> seen;
    for (int i = 0; i < 2; ++i) seen.insert(*set.wait({}));
    CHECK(seen.size() == 2);
}

TEST_CASE_METHOD(WaitStreams,
                 "wait_set: turns begin with the first, and whoever has something has one") {
    std::vector<Writer> writers;
    std::vector<Reader> readers;
    WaitSet set;
    for (const char* name : {"a", "b", "c"}) {
        writers.push_back(writer(name));
        readers.push_back(reader(name));
    }
    for (Reader& one : readers) REQUIRE(set.add(one));
    for (Writer& one : writers) one.publish({}, {});
    for (std::size_t turn = 0; turn < 7; ++turn) CHECK(set.wait({}) == turn % 3);
    for (Reader& one : readers) CHECK(one.next());
    for (const std::size_t only : {1, 0, 2, 2, 1, 1, 0, 0}) {
        writers[only].publish({}, {});
        CHECK(set.wait({}) == only);
        CHECK(readers[only].next());
        CHECK_FALSE(set.wait({}));
    }
}

TEST_CASE_METHOD(TwoStreams, "wait_set: it sleeps on the words of all its streams [threads]",
                 "[threads]") {
    if (!test::kernel_waits_for_any()) return;
    const bool by_descriptor = GENERATE(false, true);
    std::thread waiting;
    if (by_descriptor) {
        REQUIRE(set.fd());
        CHECK_FALSE(set.wait({}));
    } else {
        waiting = std::thread([&] { static_cast<void>(set.wait(seconds(60))); });
    }
    for (const char* name : {"a", "b", "a"}) CHECK(test::wake_sleeper(map(name).header().wake));
    a.publish({}, {});
    if (waiting.joinable()) waiting.join();
}

TEST_CASE_METHOD(TwoStreams, "wait_set: each of its streams wakes it [threads]", "[threads]") {
    for (int i = 0; i < 200; ++i) {
        Writer& chosen = i % 2 == 0 ? a : b;
        std::thread writing([&] { chosen.publish({}, {}); });
        const auto found = set.wait(seconds(20));
        CHECK(found == static_cast<std::size_t>(i % 2));
        CHECK((*found == 0 ? of_a : of_b).next());
        writing.join();
    }
}

TEST_CASE_METHOD(WaitStreams, "wait_set: an end is news once, a successor again") {
    auto first = std::make_unique<Writer>(writer("a"));
    Reader of_a = reader("a");
    WaitSet set;
    REQUIRE(set.add(of_a));
    CHECK(of_a.next().error().why == Pause::nothing);
    first.reset();
    CHECK(set.wait({}) == 0U);
    CHECK(of_a.next().error().why == Pause::gone);
    CHECK_FALSE(set.wait({}));
    Writer second = writer("a");
    CHECK(set.wait({}) == 0U);
    CHECK(of_a.next().error().why == Pause::restarted);
    CHECK_FALSE(set.wait({}));
}

TEST_CASE_METHOD(WaitStreams, "wait_set: what cannot be followed is not news for ever") {
    auto first = std::make_unique<Writer>(writer("a"));
    Reader of_a = reader("a");
    WaitSet set;
    REQUIRE(set.add(of_a));
    first.reset();
    const Writer other = *Writer::create(directory.path(), {"a", StreamKind::imu, 8});
    CHECK(set.wait({}) == 0U);
    CHECK(of_a.next().error().why == Pause::gone);
    CHECK_FALSE(set.wait({}));
}

TEST_CASE_METHOD(WaitStreams, "wait_set: a dead writer is news once, though its file stays") {
    Writer writing = writer("a");
    Reader of_a = reader("a");
    WaitSet set;
    REQUIRE(set.add(of_a));
    writing.heartbeat(HostTime{0});
    CHECK(set.wait(seconds(20)) == 0U);
    CHECK(of_a.next().error().why == Pause::gone);
    CHECK_FALSE(set.wait({}));
    const auto descriptor = set.fd();
    REQUIRE(descriptor);
    CHECK_FALSE(set.wait({}));
    CHECK_FALSE(readable(*descriptor, 1500));  // nor is it looked at again
}

TEST_CASE_METHOD(TwoStreams, "wait_set: its descriptor is readable until nothing is left [threads]",
                 "[threads][kernel]") {
    const auto descriptor = set.fd();
    REQUIRE(descriptor);
    CHECK(readable(*descriptor));
    CHECK_FALSE(set.wait({}));
    CHECK_FALSE(readable(*descriptor));
    for (int i = 0; i < 100; ++i) {
        (i % 2 == 0 ? a : b).publish({}, {});
        REQUIRE(readable(*descriptor, 20'000));
        const auto found = set.wait({});
        REQUIRE(found == static_cast<std::size_t>(i % 2));
        CHECK(readable(*descriptor));  // it has not been read
        CHECK((*found == 0 ? of_a : of_b).next());
        CHECK_FALSE(set.wait({}));
        CHECK_FALSE(readable(*descriptor));
    }
    CHECK(test::wake_sleeper(map("a").header().wake));
    CHECK_FALSE(set.wait({}));  // who waits again waits for the same
    CHECK_FALSE(readable(*descriptor, 50));
    a.publish({}, {});
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next());
    set.set_deadline(host_now() + milliseconds(5));
    CHECK_FALSE(set.wait({}));
    CHECK(readable(*descriptor, 20'000));
}

TEST_CASE_METHOD(WaitStreams,
                 "wait_set: a reader's own descriptor reports items, ends and restarts "
                 "[threads]",
                 "[threads]") {
    auto first = std::make_unique<Writer>(writer("a"));
    Reader of_a = reader("a");
    const auto descriptor = of_a.fd();
    REQUIRE(descriptor);
    CHECK(of_a.fd().value_or(-1) == *descriptor);
    CHECK_FALSE(of_a.next());
    CHECK_FALSE(readable(*descriptor));
    first->publish({}, {});
    first->publish({}, {});
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next());
    CHECK(readable(*descriptor));
    CHECK(of_a.next());
    CHECK_FALSE(of_a.next());
    CHECK_FALSE(readable(*descriptor));
    first.reset();
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next().error().why == Pause::gone);
    CHECK_FALSE(readable(*descriptor));
    Writer second = writer("a");
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next().error().why == Pause::restarted);
    CHECK_FALSE(of_a.next());
    second.publish({}, {});
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next());
}

TEST_CASE_METHOD(WaitStreams, "wait_set: any time is a time to wait [threads]", "[threads]") {
    Writer a = writer("a");
    Reader of_a = reader("a");
    WaitSet set;
    const HostTime begin = host_now();
    CHECK_FALSE(set.wait(milliseconds(30)));  // nothing to wait for
    CHECK(host_now() - begin >= milliseconds(30));
    REQUIRE(set.add(of_a));
    CHECK_FALSE(set.wait(nanoseconds(INT64_MIN)));
    std::thread writing([&] { a.publish({}, {}); });
    CHECK(set.wait(nanoseconds(INT64_MAX)) == 0U);
    CHECK(of_a.next(nanoseconds(INT64_MAX)));
    writing.join();
}

TEST_CASE_METHOD(WaitStreams,
                 "wait_set: a writer on another clock is no news while its heart beats",
                 "[kernel]") {
    Writer writing = writer("a");
    Reader reading = reader("a");
    const HostTime far = host_now() - seconds(1000);
    for (int i = 0; i < 2; ++i) {
        writing.heartbeat(far + milliseconds(i));
        reading.writer_alive();
    }
    const auto descriptor = reading.fd();
    REQUIRE(descriptor);
    CHECK(reading.next().error().why == Pause::nothing);
    CHECK_FALSE(readable(*descriptor, 100));
    writing.publish({}, {});
    CHECK(readable(*descriptor, 20'000));
}

TEST_CASE_METHOD(WaitStreams,
                 "wait_set: the library's threads take none of the program's signals") {
    const Writer writing = writer("a");
    Reader reading = reader("a");
    const auto before = test::threads();  // other libraries may have some of their own
    REQUIRE(reading.fd());
    const std::string own = test::wait_for_one_more(before);
    std::ifstream status("/proc/self/task/" + own + "/status");
    std::string word;
    while (status >> word && word != "SigBlk:") continue;
    std::uint64_t blocked = 0;
    status >> std::hex >> blocked;
    CHECK((blocked >> (SIGTERM - 1U) & 1U) == 1);
    test::await_sleep(std::stoi(own));  // nothing is to be done
}

TEST_CASE_METHOD(WaitStreams, "wait_set: a successor that could not be followed is tried again") {
    Writer writing = writer("a");
    Reader reading = reader("a");
    enum class By { time, descriptor, set };
    const By by = GENERATE(By::time, By::descriptor, By::set);
    WaitSet set;
    REQUIRE(set.add(reading));
    set.set_deadline(host_now() + seconds(1000));
    const int descriptor = by == By::time ? -1 : by == By::set ? *set.fd() : *reading.fd();
    REQUIRE(::chmod(directory.path().c_str(), 0777) == 0);  // nobody trusts that
    writing = writer("a");
    CHECK(reading.next().error().why == Pause::gone);
    CHECK(reading.next().error().why == Pause::gone);
    REQUIRE(::chmod(directory.path().c_str(), 0750) == 0);
    if (by == By::set) static_cast<void>(set.wait({}));
    if (by != By::time) CHECK(readable(descriptor, 20'000));
    CHECK(reading.next(seconds(20)).error().why == Pause::restarted);
}

TEST_CASE_METHOD(WaitStreams, "wait_set: too many streams are refused") {
    const Writer a = writer("a");
    Reader of_a = reader("a");
    WaitSet set;
    for (int i = 0; i < 127; ++i) REQUIRE(set.add(of_a));
    const auto refused = set.add(of_a);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Catch::Contains("second WaitSet"));
}

namespace {

/// True: a descriptor to wait by was refused, and why was said.
bool is_refused(const Expected<int>& descriptor, const std::string& what) {
    return !descriptor && descriptor.error().message().find(what) != std::string::npos;
}

/// From here on this process cannot start a thread: no stack is as large.
bool forbid_threads() {
    pthread_attr_t attributes;
    ::pthread_attr_init(&attributes);
    ::pthread_attr_setstacksize(&attributes, std::size_t{1} << 47U);
    return ::pthread_setattr_default_np(&attributes) == 0;
}

}  // namespace

TEST_CASE_METHOD(WaitStreams,
                 "wait_set: where no descriptor or thread is to be had, that is reported") {
    const Writer a = writer("a");
    Reader of_a = reader("a");
    WaitSet set;
    REQUIRE(set.add(of_a));
    CHECK(test::in_process([&] {
        const rlimit none{0, 0};
        return ::setrlimit(RLIMIT_NOFILE, &none) == 0 &&
               is_refused(set.fd(), "a descriptor to wait on") &&
               is_refused(of_a.fd(), "a descriptor to wait on");
    }));
    CHECK(test::in_process([&] {
        return forbid_threads() && is_refused(set.fd(), "a thread to wait in") &&
               is_refused(of_a.fd(), "a thread to wait in");
    }));
}
