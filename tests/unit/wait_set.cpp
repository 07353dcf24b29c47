// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/wait_set.hpp"

#include <poll.h>
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

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct Streams {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer writer(const std::string& name) const {
        return *Writer::create(directory.path(), {name, StreamKind::events, 8});
    }
    Reader reader(const std::string& name) const {
        auto opened = Reader::open(directory.path() / name);
        REQUIRE(opened);
        return std::move(*opened);
    }
};

bool readable(int descriptor, int timeout_ms = 0) {
    pollfd entry{descriptor, POLLIN, 0};
    return ::poll(&entry, 1, timeout_ms) == 1;
}

}  // namespace

TEST_CASE_METHOD(Streams, "wait_set: it names who has something, and takes turns") {
    Writer a = writer("a");
    Writer b = writer("b");
    Reader of_a = reader("a");
    Reader of_b = reader("b");
    WaitSet set;
    REQUIRE(set.add(of_a));
    REQUIRE(set.add(of_b));
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

TEST_CASE_METHOD(Streams, "wait_set: each of its streams wakes it [threads]", "[threads]") {
    Writer a = writer("a");
    Writer b = writer("b");
    Reader of_a = reader("a");
    Reader of_b = reader("b");
    WaitSet set;
    REQUIRE(set.add(of_a));
    REQUIRE(set.add(of_b));
    for (int i = 0; i < 200; ++i) {
        Writer& chosen = i % 2 == 0 ? a : b;
        std::thread writing([&] { chosen.publish({}, {}); });
        const auto found = set.wait(seconds(20));
        CHECK(found == static_cast<std::size_t>(i % 2));
        CHECK((*found == 0 ? of_a : of_b).next());
        writing.join();
    }
}

TEST_CASE_METHOD(Streams, "wait_set: an end is news once, a successor again") {
    auto first = std::make_unique<Writer>(writer("a"));
    Reader of_a = reader("a");
    WaitSet set;
    REQUIRE(set.add(of_a));
    first.reset();
    CHECK(set.wait({}) == 0U);
    CHECK(of_a.next().error().why == Pause::gone);
    CHECK_FALSE(set.wait({}));
    Writer second = writer("a");
    CHECK(set.wait({}) == 0U);
    CHECK(of_a.next().error().why == Pause::restarted);
    CHECK_FALSE(set.wait({}));
}

TEST_CASE_METHOD(Streams, "wait_set: what cannot be followed is not news for ever") {
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

TEST_CASE_METHOD(Streams, "wait_set: its descriptor is readable until nothing is left [threads]",
                 "[threads]") {
    Writer a = writer("a");
    Writer b = writer("b");
    Reader of_a = reader("a");
    Reader of_b = reader("b");
    WaitSet set;
    REQUIRE(set.add(of_a));
    REQUIRE(set.add(of_b));
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
    set.set_deadline(host_now() + milliseconds(5));
    CHECK_FALSE(set.wait({}));
    CHECK(readable(*descriptor, 20'000));
}

TEST_CASE_METHOD(Streams,
                 "wait_set: a reader's own descriptor tells items, ends and restarts "
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
    const Writer second = writer("a");
    REQUIRE(readable(*descriptor, 20'000));
    CHECK(of_a.next().error().why == Pause::restarted);
}

TEST_CASE_METHOD(Streams, "wait_set: any time is a time to wait [threads]", "[threads]") {
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

TEST_CASE_METHOD(Streams, "wait_set: a writer on another clock is no news while its heart beats") {
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

TEST_CASE_METHOD(Streams, "wait_set: the library's threads take none of the program's signals") {
    const Writer writing = writer("a");
    Reader reading = reader("a");
    REQUIRE(reading.fd());
    int own = 0;
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
        if (task.path().filename() == std::to_string(::getpid())) continue;
        std::ifstream status(task.path() / "status");
        std::string word;
        while (status >> word && word != "SigBlk:") continue;
        std::uint64_t blocked = 0;
        status >> std::hex >> blocked;
        CHECK((blocked >> (SIGTERM - 1U) & 1U) == 1);
        ++own;
    }
    CHECK(own >= 1);
}

TEST_CASE_METHOD(Streams, "wait_set: a successor that could not be followed is tried again") {
    Writer writing = writer("a");
    Reader reading = reader("a");
    const bool by_descriptor = GENERATE(false, true);
    const int descriptor = by_descriptor ? *reading.fd() : -1;
    REQUIRE(::chmod(directory.path().c_str(), 0777) == 0);  // nobody trusts that
    writing = writer("a");
    CHECK(reading.next().error().why == Pause::gone);
    CHECK(reading.next().error().why == Pause::gone);
    REQUIRE(::chmod(directory.path().c_str(), 0750) == 0);
    if (by_descriptor) CHECK(readable(descriptor, 20'000));
    CHECK(reading.next(seconds(20)).error().why == Pause::restarted);
}

TEST_CASE_METHOD(Streams, "wait_set: too many streams are refused") {
    const Writer a = writer("a");
    Reader of_a = reader("a");
    WaitSet set;
    for (int i = 0; i < 127; ++i) REQUIRE(set.add(of_a));
    const auto refused = set.add(of_a);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Catch::Contains("second WaitSet"));
}
