// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/look.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"
#include "versavis/wait_set.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::in_process;

namespace {

struct Fixture {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer inline_writer(std::uint64_t first_item = 0) {
        return *Writer::create(directory.path(),
                               {"numbers", StreamKind::events, 8, 0, 0, first_item});
    }
    Writer frame_writer(std::uint32_t slots = 4) {
        return *Writer::create(directory.path(), {"frames", StreamKind::frames, 16, slots, 5000});
    }
    Reader reader(const std::string& name, const Options& from = {}) {
        auto opened = Reader::open(directory.path() / name, from);
        REQUIRE(opened);
        return std::move(*opened);
    }
};

void publish_event(Writer& writer, std::uint64_t value) {
    writer.publish(OutputTime{static_cast<std::int64_t>(value)}, {value});
}

void publish_frame(Writer& writer, std::uint8_t fill) {
    const auto slot = writer.acquire();
    REQUIRE(slot);
    std::memset(writer.slot_data(*slot), fill, 5000);
    writer.publish(*slot, 5000, OutputTime{fill}, {fill});
}

}  // namespace

TEST_CASE_METHOD(Fixture, "ring: items come in order, with time and metadata") {
    Writer writer = inline_writer();
    Reader reader = this->reader("numbers");
    CHECK(test::look(reader.next()).found == test::Found::nothing);
    for (std::uint64_t i = 1; i <= 3; ++i) publish_event(writer, i);
    for (std::uint64_t i = 1; i <= 3; ++i) {
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        CHECK(item.metadata[0] == i);
        CHECK(item.time.ns == static_cast<std::int64_t>(i));
        CHECK(item.number == i - 1);
    }
    CHECK(test::look(reader.next()).found == test::Found::nothing);
}

TEST_CASE_METHOD(Fixture,
                 "ring: a lapped reader learns how much it lost and goes on half a ring back") {
    const std::uint64_t start =
        GENERATE(std::uint64_t{0}, (std::uint64_t{1} << 32U) - 3, std::uint64_t{1} << 63U);
    Writer writer = inline_writer(start);
    Reader reader = this->reader("numbers");
    for (std::uint64_t i = 0; i < 20; ++i) publish_event(writer, i);
    const auto lost = test::look(reader.next());
    REQUIRE(lost.found == test::Found::lost);
    CHECK(lost.lost == 16);
    CHECK(test::look(reader.next()).metadata[0] == 16);
    CHECK(test::look(reader.next()).metadata[0] == 17);
}

TEST_CASE_METHOD(Fixture, "ring: payloads are read in place and by copy") {
    Writer writer = frame_writer();
    Reader reader = this->reader("frames");
    publish_frame(writer, 7);
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    REQUIRE(item.payload.size() == 5000);
    CHECK(static_cast<int>(item.payload.data()[4999]) == 7);
    CHECK(item.valid());
    std::vector<std::byte> copy(item.payload.size());
    CHECK(item.payload.copy_to(copy.data()));
    CHECK(std::all_of(copy.begin(), copy.end(), [](std::byte b) { return b == std::byte{7}; }));
}

TEST_CASE_METHOD(Fixture, "ring: a payload that the writer took back is not intact") {
    Writer writer = frame_writer(2);
    Reader reader = this->reader("frames");
    publish_frame(writer, 1);
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    publish_frame(writer, 2);
    CHECK(item.valid());  // the other slot
    const auto slot = writer.acquire();
    CHECK_FALSE(item.valid());
    std::vector<std::byte> copy(item.payload.size());
    CHECK_FALSE(item.payload.copy_to(copy.data()));
    writer.abandon(*slot);
    CHECK_FALSE(item.valid());
}

TEST_CASE_METHOD(Fixture, "ring: items whose slot is gone count as lost") {
    Writer writer = frame_writer(2);
    Reader reader = this->reader("frames");
    for (std::uint8_t i = 1; i <= 4; ++i) publish_frame(writer, i);
    const auto lost = test::look(reader.next());
    REQUIRE(lost.found == test::Found::lost);
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    CHECK(item.number == lost.lost);
    CHECK(static_cast<std::uint64_t>(item.payload.data()[0]) == item.number + 1);
}

TEST_CASE_METHOD(Fixture,
                 "ring: slots are handed out until none is left, the oldest goes first, abandoned "
                 "ones before it") {
    Writer writer = frame_writer(3);
    const auto a = writer.acquire();
    const auto b = writer.acquire();
    const auto c = writer.acquire();
    REQUIRE((a && b && c));
    CHECK_FALSE(writer.acquire());
    writer.publish(*b, 1, {}, {});
    writer.publish(*a, 1, {}, {});
    writer.abandon(*c);
    CHECK(*writer.acquire() == *c);
    CHECK(*writer.acquire() == *b);
    CHECK(*writer.acquire() == *a);
}

TEST_CASE_METHOD(Fixture,
                 "ring: a reader sees the restart of its writer, and one that is gone for good") {
    auto first = std::make_unique<Writer>(inline_writer());
    Reader reader = this->reader("numbers");
    publish_event(*first, 1);
    {
        Writer second = inline_writer();
        publish_event(second, 100);
        first.reset();  // must not take the name away from its successor
        CHECK(test::look(reader.next()).metadata[0] == 1);
        CHECK(test::look(reader.next()).found == test::Found::restarted);
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        CHECK(item.metadata[0] == 100);
    }
    CHECK(test::look(reader.next()).found == test::Found::gone);
    CHECK(test::look(reader.next(milliseconds(1))).found == test::Found::gone);
    CHECK_FALSE(reader.writer_alive());
    Writer third = inline_writer();
    publish_event(third, 200);
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    CHECK(test::look(reader.next()).metadata[0] == 200);
}

TEST_CASE_METHOD(Fixture, "ring: a waiting reader is woken [threads]", "[threads]") {
    Writer writer = inline_writer();
    Reader reader = this->reader("numbers");
    std::atomic<bool> ready{false};
    test::Looked<Item> item;
    std::thread waiting([&] {
        ready = true;
        item = test::look(reader.next(seconds(20)));
    });
    while (!ready) std::this_thread::yield();
    publish_event(writer, 5);
    waiting.join();
    CHECK(item.found == test::Found::item);
    CHECK(item.metadata[0] == 5);
}

TEST_CASE_METHOD(Fixture,
                 "ring: a reader that races with the writer never takes torn data [threads]",
                 "[threads]") {
    Writer writer = *Writer::create(directory.path(), {"race", StreamKind::frames, 4, 3, 4096});
    Reader reader = this->reader("race");
    constexpr std::uint64_t last = 20000;
    std::atomic<bool> done{false};
    std::thread writing([&] {
        for (std::uint64_t i = 1; i <= last; ++i) {
            const auto slot = writer.acquire();
            auto* words = reinterpret_cast<std::atomic<std::uint64_t>*>(writer.slot_data(*slot));
            for (std::size_t w = 0; w < 512; ++w) words[w].store(i, std::memory_order_relaxed);
            Metadata metadata;
            metadata.fill(i);
            writer.publish(*slot, 4096, OutputTime{static_cast<std::int64_t>(i)}, metadata);
        }
        done = true;
    });
    std::uint64_t good = 0;
    std::uint64_t newest = 0;
    std::vector<std::uint64_t> copy(512);
    while (newest < last && !(done && reader.head() != last)) {
        const auto item = test::look(reader.next());
        if (item.found != test::Found::item) continue;
        for (const std::uint64_t word : item.metadata) REQUIRE(word == item.metadata[0]);
        REQUIRE(item.time.ns == static_cast<std::int64_t>(item.metadata[0]));
        REQUIRE(item.metadata[0] > newest);
        newest = item.metadata[0];
        if (!item.payload.copy_to(reinterpret_cast<std::byte*>(copy.data()))) continue;
        ++good;
        for (const std::uint64_t word : copy) REQUIRE(word == newest);
    }
    writing.join();
    CHECK(good > 0);
}

TEST_CASE_METHOD(Fixture, "ring: what is no ring is refused with a reason") {
    Writer writer = inline_writer();
    const auto error = [&](const std::string& name) {
        return Reader::open(directory.path() / name).error().message();
    };
    CHECK_THAT(error("absent"), Catch::Contains("no such stream"));
    directory.write("short", "x");
    CHECK_THAT(error("short"), Catch::Contains("not a VersaVIS ring"));
    directory.write("empty", "");
    CHECK_FALSE(Reader::open(directory.path() / "empty"));
    std::filesystem::copy_file(directory.path() / "numbers", directory.path() / "damaged");
    {
        std::fstream file(directory.path() / "damaged",
                          std::ios::in | std::ios::out | std::ios::binary);
        const std::uint64_t far = 1ULL << 40U;
        file.seekp(offsetof(Header, descriptors_at))
            .write(reinterpret_cast<const char*>(&far), sizeof far);
    }
    CHECK_THAT(error("damaged"), Catch::Contains("damaged header"));
    std::filesystem::copy_file(directory.path() / "numbers", directory.path() / "newer");
    {
        std::fstream file(directory.path() / "newer",
                          std::ios::in | std::ios::out | std::ios::binary);
        const std::uint32_t version = 2;
        file.seekp(offsetof(Header, abi_major))
            .write(reinterpret_cast<const char*>(&version), sizeof version);
    }
    CHECK_THAT(error("newer"), Catch::Contains("layout version 2, this program reads version 1"));
}

TEST_CASE_METHOD(Fixture, "ring: the directory's owner must own the segment") {
    if (geteuid() != 0) return;  // only root can give files away
    Writer writer = inline_writer();
    REQUIRE(chown((directory.path() / "numbers").c_str(), 12345, 12345) == 0);
    CHECK_THAT(Reader::open(directory.path() / "numbers").error().message(),
               Catch::Contains("does not belong"));
}

TEST_CASE_METHOD(Fixture, "ring: shapes that cannot be are refused") {
    CHECK_FALSE(Writer::create(directory.path(), {"odd", StreamKind::events, 7}));
    CHECK_FALSE(Writer::create(directory.path(), {"", StreamKind::events, 8}));
    CHECK_THAT(Writer::create(directory.path() / "absent", {"name", StreamKind::events, 8})
                   .error()
                   .message(),
               Catch::Contains("cannot be created"));
    const auto huge =
        Writer::create(directory.path(), {"huge", StreamKind::frames, 8, 1024, 1ULL << 40U});
    REQUIRE_FALSE(huge);
    CHECK_THAT(huge.error().message(),
               Catch::Contains("/huge: needs 1073741825 MiB") && Catch::Contains("/dev/shm"));
    CHECK(std::filesystem::is_empty(directory.path()));
    std::filesystem::create_directory(directory.path() / "taken");
    CHECK_THAT(Writer::create(directory.path(), {"taken", StreamKind::events, 8}).error().message(),
               Catch::Contains("cannot be renamed into place"));
    std::filesystem::remove(directory.path() / "taken");
    CHECK(std::filesystem::is_empty(directory.path()));
}

namespace {

bool write_line(const char* path, const std::string& line) {
    return static_cast<bool>(std::ofstream(path) << line << std::flush);
}

/// Where there is room among the addresses for all but such a ring.
bool cannot_be_mapped(const std::filesystem::path& directory) {
    std::uint64_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    rlimit little{};
    ::getrlimit(RLIMIT_AS, &little);
    little.rlim_cur = pages * page_size + (16 << 20);
    if (::setrlimit(RLIMIT_AS, &little) != 0) return false;
    const auto writer = Writer::create(directory, {"frames", StreamKind::frames, 8, 64, 1 << 20});
    return !writer && writer.error().message().find("cannot be mapped") != std::string::npos &&
           std::filesystem::is_empty(directory);
}

std::size_t open_files() {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

/// /dev/shm of this process alone, of 3 MiB.
bool make_memory_tight() {
    const uid_t user = ::geteuid();
    const gid_t group = ::getegid();
    if (::unshare(user == 0 ? CLONE_NEWNS : CLONE_NEWNS | CLONE_NEWUSER) != 0) return false;
    if (user != 0 && !(write_line("/proc/self/setgroups", "deny") &&
                       write_line("/proc/self/uid_map", fmt::format("{0} {0} 1", user)) &&
                       write_line("/proc/self/gid_map", fmt::format("{0} {0} 1", group))))
        return false;
    return ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
           ::mount("tmpfs", "/dev/shm", "tmpfs", 0, "size=3m,mode=0700") == 0;
}

/// Of the 3 MiB, a ring of this shape takes more than half.
const Shape large{"frames", StreamKind::frames, 8, 4, 512 << 10};

/// A ring with three frames whose writer was killed.
bool leave_dead(const std::filesystem::path& memory) {
    return in_process([&] {
        auto writer = Writer::create(memory, large);
        if (!writer) return false;
        for (std::uint8_t fill = 1; fill <= 3; ++fill) {
            const auto slot = writer->acquire();
            std::memset(writer->slot_data(*slot), fill, 512 << 10);
            writer->publish(*slot, 512 << 10, OutputTime{}, {});
        }
        ::_exit(0);  // without its destructor
    });
}

bool is_whole(const test::Looked<Item>& item, std::uint8_t fill) {
    const auto* bytes = item.payload.data();
    return item.found == test::Found::item && item.payload.size() == 512 << 10 &&
           std::all_of(bytes, bytes + item.payload.size(),
                       [&](std::byte byte) { return byte == std::byte{fill}; }) &&
           item.valid();
}

/// Takes all that is left, to the last page.
bool fill_up(const std::filesystem::path& memory) {
    std::ofstream file(memory / "filler");
    const std::vector<char> page(page_size);
    while (file.write(page.data(), page_size).flush()) continue;
    struct statvfs system {};
    return ::statvfs(memory.c_str(), &system) == 0 && system.f_bfree == 0;
}

/// Neither what is held nor what is mapped of a dead writer's ring is taken from its reader.
bool held_stays_whole() {
    const std::filesystem::path memory = "/dev/shm";
    if (!make_memory_tight() || !leave_dead(memory)) return false;
    auto reader = Reader::open(memory / "frames", {Position::oldest});
    auto dead = Mapping::open(memory / "frames", Mapping::Access::read_only);
    if (!reader || !dead) return false;
    std::vector<test::Looked<Item>> held;
    for (int i = 0; i < 2; ++i) held.push_back(test::look(reader->next()));
    const std::size_t files = open_files();
    const auto refused = Writer::create(memory, large);
    const std::string text = refused ? "" : refused.error().message();
    if (text.find("while programs still hold 3 MiB of a service that died") == text.npos ||
        text.find(", or end those that read its streams") == text.npos || open_files() != files ||
        std::filesystem::exists(memory / "frames") || !fill_up(memory))
        return false;
    const volatile auto* byte = reinterpret_cast<const std::byte*>(&dead->header());
    for (std::size_t at = 0; at < dead->size(); at += page_size) static_cast<void>(byte[at]);
    if (!is_whole(held[0], 1) || !is_whole(held[1], 2) || !held[1].stale) return false;
    // What was not read yet is there, too.
    if (!is_whole(test::look(reader->next()), 3)) return false;
    if (test::look(reader->next()).found != test::Found::gone) return false;
    std::filesystem::remove(memory / "filler");
    dead = Unexpected(Error{});
    held.pop_back();
    if (Writer::create(memory, large) || !is_whole(held[0], 1)) return false;
    held.clear();  // with the last of them, the memory
    auto writer = Writer::create(memory, large);
    if (!writer) return false;
    writer->publish(*writer->acquire(), 1, {}, {});
    return test::look(reader->next()).found == test::Found::restarted &&
           test::look(reader->next()).found == test::Found::item;
}

/// Readers let go by themselves, however they wait.
bool made_anew_in_tight_memory(const std::function<void(Reader&, const std::atomic<bool>&)>& wait) {
    const std::filesystem::path memory = "/dev/shm";
    if (!make_memory_tight() || !leave_dead(memory)) return false;
    auto reader = Reader::open(memory / "frames");
    if (!reader || test::look(reader->next()).found != test::Found::gone) return false;
    std::atomic<bool> made{false};
    std::thread waiting([&] { wait(*reader, made); });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));  // until it has looked, and sleeps
    auto writer = Writer::create(memory, large);
    made = true;
    waiting.join();
    if (!writer) return false;
    writer->publish(*writer->acquire(), 1, {}, {});
    auto item = test::look(reader->next(seconds(5)));
    if (item.found == test::Found::restarted) item = test::look(reader->next(seconds(5)));
    return item.found == test::Found::item && !item.stale;
}

void wait_in_next(Reader& reader, const std::atomic<bool>&) {
    static_cast<void>(reader.next(seconds(20)));
}

void wait_alone(Reader& reader, const std::atomic<bool>&) { reader.wait(seconds(20)); }

void wait_in_set(Reader& reader, const std::atomic<bool>&) {
    WaitSet set;
    if (set.add(reader)) set.wait(seconds(20));
}

void wait_by_poll(Reader& reader, const std::atomic<bool>& made) {
    const auto descriptor = reader.fd();
    if (!descriptor) return;
    while (!made) {
        pollfd entry{*descriptor, POLLIN, 0};
        ::poll(&entry, 1, 50);
        if (entry.revents != 0) static_cast<void>(reader.next());
    }
}

/// The ring of a dead writer that nobody makes anew, as that of a camera that is away.
bool made_beside_the_dead() {
    const std::filesystem::path memory = "/dev/shm";
    if (!make_memory_tight() || !leave_dead(memory)) return false;
    const bool left = in_process([&]() -> bool {
        const auto writer = Writer::create({memory, true}, {"sealed", StreamKind::events, 8});
        ::_exit(writer ? 0 : 1);
    });
    const auto own = Writer::create(memory, {"own", StreamKind::events, 8});
    const auto served = Writer::create({memory, true}, {"served", StreamKind::events, 8});
    const auto other = Writer::create(memory, {"other", StreamKind::frames, 8, 4, 512 << 10});
    return left && own && served && other && Reader::open(memory / "own")->writer_alive() &&
           Reader::open(memory / "served") && !std::filesystem::exists(memory / "sealed") &&
           !std::filesystem::exists(memory / "frames");
}

/// What nobody holds is not called so.
bool names_no_holders() {
    const std::filesystem::path memory = "/dev/shm";
    if (!make_memory_tight() || !leave_dead(memory)) return false;
    const auto refused = Writer::create(memory, {"huge", StreamKind::frames, 8, 64, 512 << 10});
    return !refused && !std::filesystem::exists(memory / "frames") &&
           refused.error().message().find("still hold") == std::string::npos;
}

/// A writer in another container, of which nothing shows that it lives but its heart.
bool spares_whose_heart_beats() {
    const std::filesystem::path memory = "/dev/shm";
    if (!make_memory_tight() || !leave_dead(memory)) return false;
    const auto segment = Mapping::open(memory / "frames", Mapping::Access::read_write);
    if (!segment) return false;
    Header& header = segment->header();
    ++header.pid_namespace;
    header.heartbeat_ns = host_now().ns;
    std::atomic<bool> stop{false};
    std::thread heart([&] {
        for (; !stop; std::this_thread::sleep_for(std::chrono::milliseconds(50)))
            header.heartbeat_ns = host_now().ns;
    });
    const auto refused = Writer::create(memory, {"other", StreamKind::frames, 8, 4, 512 << 10});
    stop = true;
    heart.join();
    return !refused && refused.error().message().find("programs still hold") == std::string::npos &&
           header.state == static_cast<std::uint32_t>(WriterState::live) &&
           std::filesystem::exists(memory / "frames");
}

}  // namespace

TEST_CASE_METHOD(Fixture, "ring: one that cannot be mapped leaves nothing behind", "[kernel]") {
    CHECK(in_process([&] { return cannot_be_mapped(directory.path()); }));
}

TEST_CASE_METHOD(Fixture,
                 "ring: a service without standard input writes as well, and no file stays") {
    const std::size_t files = open_files();
    const int input = ::dup(0);
    ::close(0);
    {
        const Writer writer = frame_writer();
        CHECK(open_files() == files);
    }
    CHECK(open_files() == files);
    ::dup2(input, 0);
    ::close(input);
}

TEST_CASE("ring: a dead writer's memory is used again where there is no other") {
    if (!in_process(make_memory_tight)) {
        WARN("not tested: in a chroot no process can have a /dev/shm of its own");
        return;
    }
    CHECK(in_process(held_stays_whole));
    CHECK(in_process(made_beside_the_dead));
    CHECK(in_process(names_no_holders));
    CHECK(in_process(spares_whose_heart_beats));
    for (const auto wait : {wait_in_next, wait_alone, wait_in_set, wait_by_poll})
        CHECK(in_process([&] { return made_anew_in_tight_memory(wait); }));
}

TEST_CASE_METHOD(Fixture, "ring: no item is lost when one writer follows another [threads]",
                 "[threads]") {
    constexpr std::uint64_t lives = 300;
    constexpr std::uint64_t items = 20;
    std::atomic<std::uint64_t> followed{0};
    auto first = std::make_unique<Writer>(inline_writer());
    Reader reader = this->reader("numbers");
    std::thread writing([&] {
        auto writer = std::move(first);
        for (std::uint64_t life = 0; life < lives; ++life) {
            for (std::uint64_t i = 0; i < items; ++i) publish_event(*writer, life * items + i);
            // The next follows when the reader has followed so far: it may skip no life.
            while (followed < life) std::this_thread::yield();
            if (life + 1 < lives) writer = std::make_unique<Writer>(inline_writer());
        }
        while (followed + 1 < lives) std::this_thread::yield();
    });
    std::uint64_t expected = 0;
    while (expected < lives * items) {
        const auto item = test::look(reader.next());
        if (item.found == test::Found::restarted) ++followed;
        if (item.found == test::Found::lost) expected += item.lost;
        if (item.found != test::Found::item) continue;
        REQUIRE(item.metadata[0] == expected);
        ++expected;
    }
    writing.join();
}
