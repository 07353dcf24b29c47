// SPDX-License-Identifier: BSD-3-Clause
// Where a reader begins, what it makes of a writer that died, lied or took back, and how it waits.
#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <iterator>
#include <thread>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/look.hpp"
#include "../support/sleep.hpp"
#include "../support/temporary_directory.hpp"
#include "client/futex.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::in_process;

namespace {

struct ReaderStreams {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer events(std::uint32_t descriptors = 8) {
        return *Writer::create(directory.path(), {"events", StreamKind::events, descriptors});
    }
    Writer frames(std::uint32_t slots, std::uint64_t size = page_size) {
        return *Writer::create(directory.path(), {"frames", StreamKind::frames, 8, slots, size});
    }
    Reader open(const std::string& name, const Options& from = {}) {
        auto opened = Reader::open(directory.path() / name, from);
        REQUIRE(opened);
        return std::move(*opened);
    }
    Mapping map(const std::string& name) {
        return *Mapping::open(directory.path() / name, Mapping::Access::read_write);
    }
    std::string refusal(const std::string& name) {
        const auto opened = Reader::open(directory.path() / name);
        return opened ? "" : opened.error().message();
    }
};

void publish_bytes(Writer& writer, std::uint32_t length, std::uint8_t fill = 1) {
    const auto slot = writer.acquire();
    REQUIRE(slot);
    std::memset(writer.slot_data(*slot), fill, length);
    writer.publish(*slot, length, OutputTime{}, {});
}

std::int64_t processor_time_ns() {
    timespec used{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    return used.tv_sec * 1'000'000'000 + used.tv_nsec;
}

long wakes_of_this_thread() {
    rusage usage{};
    ::getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_nvcsw;
}

/// How long a thread waits for a change of `word` that `act` causes.
Duration slept_through(const std::atomic<std::uint32_t>& word, const std::function<void()>& act) {
    std::atomic<pid_t> number{0};
    Duration slept;
    std::thread sleeper([&] {
        const std::uint32_t before = word;
        number = ::gettid();
        const HostTime begun = host_now();
        futex_wait(word, before, seconds(30).ns);
        slept = host_now() - begun;
    });
    while (number == 0) std::this_thread::yield();
    test::await_sleep(number);
    act();
    sleeper.join();
    return slept;
}

}  // namespace

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a copy has all of the payload, and nothing beyond") {
    Writer writer = frames(2);
    Reader reader = open("frames");
    for (std::uint32_t size = 0; size <= 200; ++size) {
        const auto slot = writer.acquire();
        REQUIRE(slot);
        for (std::uint32_t i = 0; i < size; ++i)
            writer.slot_data(*slot)[i] = static_cast<std::byte>(i * 7 + size);
        writer.publish(*slot, size, OutputTime{}, {});
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        REQUIRE(item.payload.size() == size);
        std::vector<std::byte> copy(size + 16, std::byte{0xA5});
        REQUIRE(item.payload.copy_to(copy.data()));
        for (std::uint32_t i = 0; i < copy.size(); ++i)
            REQUIRE(copy[i] == (i < size ? static_cast<std::byte>(i * 7 + size) : std::byte{0xA5}));
    }
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: the last slot is read to its end, which is the file's") {
    Writer writer = frames(2);
    // The next mapping usually ends where this page begins, which nobody may read.
    const void* guard = ::mmap(nullptr, page_size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    Reader reader = open("frames");
    for (int i = 0; i < 2; ++i) publish_bytes(writer, page_size, 9);
    std::vector<std::byte> copy(page_size);
    test::Looked<Item> item;
    for (int i = 0; i < 2; ++i) {
        item = test::look(reader.next());
        CHECK(item.payload.copy_to(copy.data()));
    }
    CHECK(copy.back() == std::byte{9});
    if (item.payload.data() + page_size != guard)
        WARN("not tested: something lies behind the mapping");
    ::munmap(const_cast<void*>(guard), page_size);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: an item without payload is intact, and a copy of nothing") {
    Writer writer = events();
    Reader reader = open("events");
    for (int lap = 0; lap < 3; ++lap)
        for (std::uint64_t i = 0; i < 8; ++i) {
            writer.publish(OutputTime{}, {1, i});
            const auto item = test::look(reader.next());
            REQUIRE(item.found == test::Found::item);
            CHECK(item.payload.data() == nullptr);
            CHECK(item.payload.size() == 0);
            CHECK(item.valid());
            CHECK(item.payload.copy_to(nullptr));
        }
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: where nothing is, the item says so") {
    Writer writer = events();
    const auto item = test::look(open("events").next());
    CHECK(item.found == test::Found::nothing);
    CHECK(item.lost == 0);
    CHECK(item.number == 0);
    CHECK(item.time.life == 0);
    CHECK_FALSE(item.stale);
    CHECK(item.time.ns == 0);
    CHECK(item.payload.data() == nullptr);
    CHECK(item.payload.size() == 0);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: one that wants the past begins half a ring back") {
    Writer writer = events();
    for (std::uint64_t i = 0; i < 3; ++i) writer.publish(OutputTime{}, {i});
    CHECK(test::look(open("events", {Position::middle}).next()).number == 0);
    for (std::uint64_t i = 3; i < 20; ++i) writer.publish(OutputTime{}, {i});
    const auto item = test::look(open("events", {Position::middle}).next());
    CHECK(item.found == test::Found::item);
    CHECK(item.number == 16);
    CHECK(test::look(open("events").next()).found == test::Found::nothing);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: each place is where it says, and holds what is read next") {
    Writer writer = events(64);
    const auto first_from = [&](Position position) {
        return test::look(open("events", {position}).next());
    };
    for (const Position position : {Position::oldest, Position::middle, Position::latest}) {
        Reader early = open("events", {position});
        CHECK(test::look(early.next()).found == test::Found::nothing);
    }
    for (std::uint64_t i = 0; i < 64; ++i) {
        writer.publish(OutputTime{}, {i});
        CHECK(first_from(Position::oldest).number == 0);  // nothing is about to be overwritten
        CHECK(first_from(Position::latest).number == i);
    }
    for (std::uint64_t i = 64; i < 100; ++i) writer.publish(OutputTime{}, {i});
    Reader from_oldest = open("events", {Position::oldest});
    Reader from_middle = open("events", {Position::middle});
    for (std::uint64_t i = 100; i < 104; ++i) writer.publish(OutputTime{}, {i});
    const auto oldest = test::look(from_oldest.next());
    CHECK(oldest.found == test::Found::item);
    CHECK(oldest.number < 100 - 32);
    CHECK(test::look(from_middle.next()).number == 100 - 32);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: the oldest item is found, however many were given back") {
    constexpr std::uint64_t slots = 8;
    for (std::uint64_t published = 0; published <= 2 * slots; ++published)
        for (std::uint64_t taken = 0; taken <= slots; ++taken) {
            Writer writer = frames(slots);
            for (std::uint64_t i = 0; i < published; ++i) publish_bytes(writer, 10);
            for (std::uint64_t i = 0; i < taken; ++i) REQUIRE(writer.acquire());
            const std::uint64_t there = std::min({published, slots, slots - taken});
            Reader reader = open("frames");
            CHECK(reader.seek(EpochTime{reader.life(), INT64_MIN, 0}));
            const auto item = test::look(reader.next());
            CHECK(item.found == (there == 0 ? test::Found::nothing : test::Found::item));
            CHECK(item.number == (there == 0 ? 0 : published - there));
        }
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: the middle is never where the writer is next") {
    Writer writer = frames(8);
    for (int i = 0; i < 8; ++i) publish_bytes(writer, 10);
    for (int i = 0; i < 4; ++i) REQUIRE(writer.acquire());
    Reader reader = open("frames", {Position::middle});
    REQUIRE(writer.acquire());
    CHECK(test::look(reader.next()).found == test::Found::item);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a time is sought, and so many items before it") {
    Writer writer = events();
    for (const std::int64_t time : {100, 300, 200, 400, 500}) writer.publish(OutputTime{time}, {});
    Reader reader = open("events");
    const auto first_from = [&](std::int64_t time, std::uint64_t earlier) {
        REQUIRE(reader.seek(EpochTime{reader.life(), time, 0}, earlier));
        return test::look(reader.next());
    };
    CHECK(reader.seek(EpochTime{reader.life(), 400, 0}));
    CHECK(test::look(reader.next()).number == 3);
    CHECK(first_from(250, 0).number == 3);  // an earlier one is not later than it
    CHECK(first_from(401, 0).number == 4);
    CHECK(first_from(400, 1).number == 2);
    CHECK(first_from(400, 3).number == 0);
    CHECK(first_from(400, 9).number == 0);
    CHECK(first_from(INT64_MIN, 0).number == 0);
    CHECK(first_from(501, 0).found == test::Found::nothing);
    writer.publish(OutputTime{600}, {});
    CHECK(test::look(reader.next()).number == 5);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a time is sought in its epoch, and in its life") {
    Writer writer = events();
    const auto publish = [&](std::int64_t time_ns, std::uint32_t epoch) {
        EventMetadata event{};
        event.epoch = epoch;
        writer.publish(OutputTime{time_ns}, pack(event));
    };
    for (const std::int64_t time : {900, 1000}) publish(time, 4);
    for (const std::int64_t time : {300, 400}) publish(time, 5);  // the clock went back
    Reader reader = open("events");
    const auto first_from = [&](std::int64_t time, std::uint32_t epoch) {
        REQUIRE(reader.seek(EpochTime{reader.life(), time, epoch}));
        return test::look(reader.next());
    };
    CHECK(first_from(950, 4).number == 1);
    CHECK(first_from(1001, 4).number == 2);  // all of a later epoch come after it
    CHECK(first_from(0, 5).number == 2);
    CHECK(first_from(350, 5).number == 3);
    const auto last = first_from(400, 5);
    CHECK(last.time.epoch == 5);
    CHECK(last.time.life == reader.life());
    CHECK(first_from(0, 3).number == 0);
    CHECK_FALSE(reader.seek(EpochTime{reader.life() + 1, 0, 5}));
    CHECK_FALSE(reader.seek(EpochTime{reader.life(), 0, no_epoch}));
    CHECK(test::look(reader.next()).number == 1);  // it stayed where it was

    Writer status = *Writer::create(directory.path(), {"status", StreamKind::status, 8});
    status.publish(OutputTime{5}, {});
    Reader documents = open("status", {Position::oldest});
    CHECK_FALSE(documents.seek(EpochTime{documents.life(), 0, 5}));
    CHECK(test::look(documents.next()).time.epoch == no_epoch);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: an item that is lost alone is passed over alone") {
    Writer writer = frames(8);
    Reader reader = open("frames");
    for (int i = 0; i < 8; ++i) publish_bytes(writer, 10);
    map("frames").generation(6) += 2;
    for (std::uint64_t i = 0; i < 6; ++i) CHECK(test::look(reader.next()).number == i);
    const auto lost = test::look(reader.next());
    CHECK(lost.found == test::Found::lost);
    CHECK(lost.lost == 1);
    CHECK(test::look(reader.next()).number == 7);
}

TEST_CASE("ring_reader: each reason why there is no item has a sentence") {
    const auto text = [](Pause why) { return NoItem{why, 7}.message(); };
    CHECK_THAT(text(Pause::nothing), Catch::Contains("nothing new"));
    CHECK_THAT(text(Pause::lost), Catch::Contains("7 items"));
    CHECK_THAT(text(Pause::restarted), Catch::Contains("restarted"));
    CHECK_THAT(text(Pause::gone), Catch::Contains("gone"));
    CHECK(NoItem{}.why == Pause::nothing);
    CHECK(NoItem{}.lost == 0);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: where only one payload is gone, only one item is lost") {
    Writer writer = frames(4);
    Reader reader = open("frames");
    publish_bytes(writer, 10);
    for (int i = 0; i < 4; ++i) CHECK(writer.acquire());
    const auto lost = test::look(reader.next());
    CHECK(lost.found == test::Found::lost);
    CHECK(lost.lost == 1);
    CHECK(test::look(reader.next()).found == test::Found::nothing);
    writer.publish(2, 10, OutputTime{}, {});
    CHECK(test::look(reader.next()).number == 1);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a slot that is not there, or too small, is no item") {
    Writer writer = frames(2);
    const Mapping mapping = map("frames");
    const auto found_with = [&](std::uint64_t length, std::uint64_t slot) {
        Reader reader = open("frames");
        publish_bytes(writer, 10);
        Descriptor& descriptor = mapping.descriptor(writer.head() - 1);
        const std::uint64_t real = descriptor.length_and_slot;
        if (slot >= 2) descriptor.slot_generation = 0;  // as the words behind the last one
        descriptor.length_and_slot = length << 32U | (slot == 0 ? real & 0xFFFFFFFFU : slot);
        return test::look(reader.next()).found;
    };
    CHECK(found_with(page_size, 0) == test::Found::item);
    CHECK(found_with(page_size + 1, 0) == test::Found::lost);
    CHECK(found_with(10, 2) == test::Found::lost);
    CHECK(found_with(10, 0xFFFFFFFE) == test::Found::lost);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: an item outlives its ring, its reader and its file") {
    auto large = std::make_unique<Writer>(frames(4));
    auto reader = std::make_unique<Reader>(open("frames"));
    for (std::uint8_t i = 0; i < 3; ++i) publish_bytes(*large, 10, i);
    test::Looked<Item> item;
    for (int i = 0; i < 3; ++i) item = test::look(reader->next());
    Writer small = frames(2);
    large.reset();
    REQUIRE(test::look(reader->next()).found == test::Found::restarted);
    reader.reset();
    std::filesystem::remove(directory.path() / "frames");
    std::vector<std::byte> copy(item.payload.size());
    CHECK(item.payload.copy_to(copy.data()));
    CHECK(copy == std::vector<std::byte>(10, std::byte{2}));
    CHECK(item.valid());
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: the newest item, once, whatever lies before it") {
    Writer writer = events();
    Reader reader = open("events");
    CHECK(test::look(reader.latest()).found == test::Found::nothing);
    writer.publish(OutputTime{}, {0});
    CHECK(test::look(open("events").latest()).found == test::Found::item);
    for (std::uint64_t i = 1; i < 5; ++i) writer.publish(OutputTime{}, {i});
    CHECK(test::look(reader.latest()).number == 4);
    CHECK(test::look(reader.latest()).found == test::Found::nothing);
    CHECK(test::look(open("events").latest()).number == 4);  // also what came before it opened
    writer.publish(OutputTime{}, {5});
    CHECK(test::look(reader.next()).number == 5);
    CHECK(test::look(reader.latest(milliseconds(1))).found == test::Found::nothing);
    for (std::uint64_t i = 6; i < 40; ++i) writer.publish(OutputTime{}, {i});
    CHECK(test::look(reader.latest()).number == 39);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: the newest item is reported lost where no newer one comes") {
    Writer writer = frames(4);
    Reader reader = open("frames");
    publish_bytes(writer, 10);
    for (int i = 0; i < 4; ++i) CHECK(writer.acquire());
    CHECK(test::look(reader.latest()).found == test::Found::lost);
    writer.publish(0, 10, OutputTime{}, {});
    CHECK(test::look(reader.latest()).number == 1);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: what is read after the end is stale, after a restart not") {
    auto writer = std::make_unique<Writer>(events());
    Reader reader = open("events");
    const std::uint64_t life = reader.life();
    for (std::uint64_t i = 0; i < 3; ++i) writer->publish(OutputTime{}, {i});
    const auto fresh = test::look(reader.next());
    CHECK_FALSE(fresh.stale);
    CHECK(life != 0);
    CHECK(fresh.time.life == life);
    writer.reset();
    for (std::uint64_t i = 1; i < 3; ++i) {
        const auto stale = test::look(reader.next());
        CHECK(stale.number == i);
        CHECK(stale.stale);
    }
    CHECK(test::look(reader.next()).found == test::Found::gone);
    writer = std::make_unique<Writer>(events());
    for (std::uint64_t i = 0; i < 3; ++i) writer->publish(OutputTime{}, {i});
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    const auto newest = test::look(reader.latest());
    CHECK(newest.number == 2);
    CHECK_FALSE(newest.stale);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a loss is reported though the writer has ended") {
    auto writer = std::make_unique<Writer>(events());
    Reader reader = open("events");
    const bool by_descriptor = GENERATE(false, true);
    if (by_descriptor) REQUIRE(reader.fd());
    CHECK(test::look(reader.next()).found == test::Found::nothing);
    for (std::uint64_t i = 0; i < 20; ++i) writer->publish(OutputTime{}, {i});
    writer.reset();
    const auto lost = test::look(reader.next());
    CHECK(lost.found == test::Found::lost);
    CHECK(test::look(reader.next()).number == lost.lost);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a writer that falls silent is reported each time, at once") {
    Writer writer = events();
    Reader reader = open("events");
    const bool with_items = GENERATE(false, true);
    for (int i = 0; i < 2; ++i) {
        writer.heartbeat(host_now());
        CHECK(reader.writer_alive());
        if (with_items) {
            writer.publish(OutputTime{}, {});
            CHECK(test::look(reader.next()).found == test::Found::item);
        }
        CHECK(test::look(reader.next()).found == test::Found::nothing);
        writer.heartbeat(HostTime{0});
        CHECK(test::look(reader.next(nanoseconds(INT64_MAX))).found == test::Found::gone);
    }
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a writer on another clock lives once its heart has beaten",
                 "[kernel]") {
    Writer writer = events();
    const HostTime far = host_now() - seconds(1000);
    writer.heartbeat(far);
    Reader reader = open("events");
    writer.heartbeat(far + milliseconds(1));
    CHECK(reader.writer_alive());
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a copy of a segment is no successor") {
    auto writer = std::make_unique<Writer>(events());
    Reader reader = open("events");
    const auto copy = directory.path() / "copy";
    std::filesystem::copy_file(directory.path() / "events", copy);
    writer.reset();
    std::filesystem::rename(copy, directory.path() / "events");
    CHECK(test::look(reader.next()).found == test::Found::gone);
}

namespace {

/// Of this process, of one file.
struct Mapped {
    int mappings = 0;
    int in_memory = 0;  ///< how many of them are so, to the last page
};

Mapped mapped(const std::filesystem::path& file) {
    Mapped found;
    std::ifstream maps("/proc/self/smaps");
    for (std::string line; std::getline(maps, line);) {
        if (line.find(file.string()) == std::string::npos) continue;
        std::string size;
        std::string resident;
        for (std::string word; maps >> word && word != "Rss:";)
            if (word == "Size:") maps >> size;
        maps >> resident;
        ++found.mappings;
        if (resident == size) ++found.in_memory;
    }
    return found;
}

}  // namespace

TEST_CASE_METHOD(ReaderStreams, "ring_reader: all that it may read is in memory from the beginning",
                 "[kernel]") {
    const Writer writer = frames(64);
    const Reader reader = open("frames");
    const Mapped found = mapped(directory.path() / "frames");
    CHECK(found.mappings == 2);
    CHECK(found.in_memory == 2);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: what a dead writer left is read, but not fetched into memory",
                 "[kernel]") {
    Writer writer = frames(64);
    publish_bytes(writer, 10, 7);
    writer.heartbeat(HostTime{0});
    Reader reader = open("frames", {Position::oldest});
    const Mapped found = mapped(directory.path() / "frames");
    CHECK(found.mappings == 2);
    CHECK(found.in_memory == 1);  // the writer's
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    CHECK(item.stale);
    CHECK(item.payload.data()[9] == std::byte{7});
    CHECK(item.valid());
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: of a ring without a name nothing is kept but what is held") {
    Writer writer = frames(4);
    const auto path = directory.path() / "frames";
    Reader reader = open("frames");
    for (std::uint8_t fill = 1; fill <= 2; ++fill) publish_bytes(writer, 10, fill);
    auto held = test::look(reader.next());
    writer.heartbeat(HostTime{0});
    std::filesystem::remove(path);
    CHECK(test::look(reader.next()).payload.data()[0] == std::byte{2});
    CHECK(mapped(path).mappings == 2);
    CHECK(test::look(reader.next(seconds(20))).found == test::Found::gone);
    CHECK(mapped(path).mappings == 2);
    CHECK(held.payload.data()[0] == std::byte{1});
    CHECK(held.valid());
    held = {};
    CHECK(mapped(path).mappings == 1);  // the writer's
    CHECK(reader.name() == std::string("frames"));
    CHECK(reader.kind() == StreamKind::frames);
    CHECK(reader.head() == 2);
    CHECK(reader.writer_pid() == static_cast<std::uint32_t>(::getpid()));
    CHECK_FALSE(reader.writer_alive());
    for (const Position position : {Position::oldest, Position::middle, Position::latest}) {
        reader.seek(position);
        CHECK(test::look(reader.next()).found == test::Found::gone);
        CHECK(test::look(reader.latest(milliseconds(1))).found == test::Found::gone);
    }
    Writer second = frames(4);
    publish_bytes(second, 10, 3);
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    CHECK(test::look(reader.next()).payload.data()[0] == std::byte{3});
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: what came late is read before a ring without a name is left") {
    Writer writer = events();
    Reader reader = open("events");
    writer.heartbeat(HostTime{0});
    CHECK(test::look(reader.next(seconds(20))).found == test::Found::gone);
    writer.publish(OutputTime{}, {7});
    std::filesystem::remove(directory.path() / "events");
    const auto late = test::look(reader.next(milliseconds(1)));
    CHECK(late.found == test::Found::item);
    CHECK(late.metadata[0] == 7);
    CHECK(test::look(reader.next(seconds(20))).found == test::Found::gone);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a ring whose memory was taken back is refused, and takes none") {
    Writer writer = frames(4);
    const auto path = directory.path() / "frames";
    const FileDescriptor file(::open(path.c_str(), O_RDWR | O_CLOEXEC));
    const auto size = static_cast<off_t>(4 * page_size);
    const off_t begin = static_cast<off_t>(std::filesystem::file_size(path)) - size;
    REQUIRE(::fallocate(file.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, begin, size) == 0);
    const auto blocks = [&] {
        struct stat status {};
        ::fstat(file.get(), &status);
        return status.st_blocks;
    };
    const auto before = blocks();
    writer.heartbeat(HostTime{0});
    CHECK(refusal("frames") ==
          path.string() +
              ": its service died and its memory was taken back; wait for the service to start");
    CHECK(blocks() == before);
    writer.heartbeat(host_now());
    CHECK(refusal("frames").empty());
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: what a writer taken for dead still published is not skipped") {
    auto first = std::make_unique<Writer>(events());
    Reader reader = open("events");
    first->publish(OutputTime{}, {1});
    first->heartbeat(HostTime{0});
    Writer second = events();
    second.publish(OutputTime{}, {2});
    CHECK(test::look(reader.next()).metadata[0] == 1);
    first->publish(OutputTime{}, {3});
    CHECK(test::look(reader.next()).metadata[0] == 3);
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    CHECK(test::look(reader.next()).metadata[0] == 2);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a writer lives while its heart beats, and is found by its start") {
    Writer writer = events();
    Reader reader = open("events");
    CHECK(reader.writer_pid() == static_cast<std::uint32_t>(::getpid()));
    for (const auto& [age_s, alive] : {std::pair{0, true}, {2, true}, {4, false}, {60, false}}) {
        writer.heartbeat(host_now() - seconds(age_s));
        CHECK(reader.writer_alive() == alive);
        CHECK(test::look(reader.next()).found ==
              (alive ? test::Found::nothing : test::Found::gone));
    }
    // What it published before it fell silent is read all the same.
    writer.publish(OutputTime{}, {});
    CHECK(test::look(reader.next()).found == test::Found::item);
    const Mapping mapping = map("events");
    mapping.header().writer_start_ticks += 1;
    writer.heartbeat(host_now() - milliseconds(200));  // from then on the start is looked at
    CHECK_FALSE(open("events").writer_alive());
    mapping.header().writer_start_ticks -= 1;
    CHECK(open("events").writer_alive());
    mapping.header().writer_pid = 0x7FFFFFFF;
    writer.heartbeat(host_now());
    CHECK_FALSE(open("events").writer_alive());
    mapping.header().pid_namespace += 1;  // its processes have numbers of their own
    CHECK(open("events").writer_alive());
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: whatever becomes of a header, a reader reads on") {
    Writer writer = frames(4);
    Reader reader = open("frames");
    const Mapping mapping = map("frames");
    const auto read = [&] {
        publish_bytes(writer, 100, 7);
        const auto item = test::look(reader.next());
        REQUIRE(item.found == test::Found::item);
        std::vector<std::byte> bytes(item.payload.size());
        CHECK(item.payload.copy_to(bytes.data()));
        CHECK(bytes == std::vector<std::byte>(100, std::byte{7}));
    };
    read();
    Header& header = mapping.header();
    std::memset(header.name, 'x', sizeof header.name);
    header.kind = StreamKind::imu;
    header.total_size = header.slot_size = header.writer_start_ticks = UINT64_MAX;
    header.descriptors_at = header.generations_at = header.slots_at = UINT64_MAX;
    header.descriptor_count = header.slot_count = header.writer_pid = UINT32_MAX;
    for (int i = 0; i < 20; ++i) read();
    CHECK(std::string(reader.name()) == "frames");
    CHECK(reader.kind() == StreamKind::frames);
    CHECK(reader.retained() == 4);
    for (const std::int64_t heartbeat : {INT64_MIN + 1, INT64_MIN}) {
        header.heartbeat_ns = heartbeat;
        CHECK_FALSE(reader.writer_alive());
    }
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: a successor of another kind is another stream") {
    auto first = std::make_unique<Writer>(
        *Writer::create(directory.path(), {"data", StreamKind::events, 8}));
    Reader reader = open("data");
    Writer second = *Writer::create(directory.path(), {"data", StreamKind::imu, 8});
    first.reset();
    second.publish(OutputTime{}, {});
    CHECK(test::look(reader.next()).found == test::Found::gone);
    CHECK(reader.kind() == StreamKind::events);
    Writer third = *Writer::create(directory.path(), {"data", StreamKind::events, 8});
    CHECK(test::look(reader.next()).found == test::Found::restarted);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: whoever may not read learns so, and what to do") {
    CHECK_THAT(refusal("absent"),
               Catch::Contains("no such stream") && Catch::Contains("is the service running?"));
    Writer writer = events();
    if (::geteuid() != 0) return;  // only root can become somebody else
    CHECK(::chmod(directory.path().c_str(), 0700) == 0);
    CHECK(in_process([&] {
        if (::setegid(12345) != 0 || ::seteuid(12345) != 0) return false;
        const std::string text = refusal("events");
        return text.find("permission denied") != std::string::npos &&
               text.find("join the group") != std::string::npos;
    }));
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: one that waits sleeps") {
    Writer writer = events();
    Reader reader = open("events");
    const HostTime begun = host_now();
    const std::int64_t used = processor_time_ns();
    const long wakes = wakes_of_this_thread();
    CHECK(test::look(reader.next(milliseconds(200))).found == test::Found::nothing);
    CHECK(host_now() - begun >= milliseconds(200));
    CHECK(processor_time_ns() - used < milliseconds(100).ns);
    CHECK(wakes_of_this_thread() - wakes < 50);
    writer.publish(OutputTime{}, {});
    CHECK(test::look(reader.next(seconds(20))).found == test::Found::item);
    CHECK(test::look(reader.next({})).found == test::Found::nothing);
    const HostTime begun_again = host_now();
    reader.wait(milliseconds(30));
    CHECK(host_now() - begun_again >= milliseconds(30));
    writer.publish(OutputTime{}, {});
    reader.wait(nanoseconds(INT64_MAX));
    CHECK(test::look(reader.next()).found == test::Found::item);
}

TEST_CASE_METHOD(ReaderStreams, "ring_reader: one that waits sleeps on its stream's word [threads]",
                 "[threads]") {
    Writer writer = events();
    Reader reader = open("events");
    const Mapping mapping = map("events");
    const bool for_an_item = GENERATE(true, false);
    std::thread waiting([&] {
        if (!for_an_item) reader.wait(seconds(60));
        static_cast<void>(reader.next(seconds(60)));
    });
    CHECK(test::wake_sleeper(mapping.header().wake));
    writer.publish(OutputTime{}, {});
    waiting.join();
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a descriptor forgets no item of a busy writer [threads]",
                 "[threads]") {
    constexpr std::uint64_t last = 20'000;
    Writer writer = events(1024);
    Reader reader = open("events");
    const auto descriptor = reader.fd();
    REQUIRE(descriptor);
    std::thread writing([&] {
        for (std::uint64_t i = 0; i < last; ++i) writer.publish(OutputTime{}, {i});
    });
    std::uint64_t seen = 0;
    for (bool notified = true; notified && seen < last;) {
        pollfd entry{*descriptor, POLLIN, 0};
        notified = ::poll(&entry, 1, 20'000) == 1;
        const auto found = test::look(reader.next());
        seen += found.found == test::Found::item ? 1 : found.lost;
    }
    writing.join();
    CHECK(seen == last);
    CHECK(test::look(reader.next()).found == test::Found::nothing);
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: a sleeper wakes at each item, and when the segment ends "
                 "[threads]",
                 "[threads]") {
    auto writer = std::make_unique<Writer>(events());
    const Mapping mapping = map("events");
    const auto& wake = mapping.header().wake;
    CHECK(slept_through(wake, [&] { writer->publish(OutputTime{}, {}); }) < seconds(15));
    CHECK(slept_through(wake, [&] { writer.reset(); }) < seconds(15));
}

TEST_CASE("ring_reader: a wait without news lasts as long as was asked") {
    const std::atomic<std::uint32_t> word{7};
    for (const Duration span : {milliseconds(30), milliseconds(1100)}) {
        const HostTime begun = host_now();
        futex_wait(word, 7, span.ns);
        CHECK(host_now() - begun >= span);
    }
    const HostTime begun = host_now();
    futex_wait(word, 8, seconds(30).ns);
    CHECK(host_now() - begun < seconds(15));
}

TEST_CASE_METHOD(ReaderStreams,
                 "ring_reader: no mixture of two items is taken from one descriptor [threads]",
                 "[threads]") {
    Writer writer = events(1);
    Reader reader = open("events");
    std::atomic<bool> done{false};
    std::thread writing([&] {
        for (std::uint64_t i = 0; i < 200'000; ++i) {
            Metadata metadata;
            metadata.fill(i);
            writer.publish(OutputTime{static_cast<std::int64_t>(i)}, metadata);
        }
        done = true;
    });
    while (!done) {
        const auto item = test::look(reader.next());
        if (item.found != test::Found::item) continue;
        for (const std::uint64_t word : item.metadata) REQUIRE(word == item.number);
        REQUIRE(item.time.ns == static_cast<std::int64_t>(item.number));
    }
    writing.join();
}
