// SPDX-License-Identifier: BSD-3-Clause
// A writer is killed at each instruction of a publication, and at each system call of making a
// ring; readers and successors find what they should.
#include <sys/mman.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <memory>

#include "../support/look.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/ring/directory.hpp"
#include "engine/ring/writer.hpp"
#include "stepped.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::Found;
using test::look;
using test::Step;
using test::Stepped;

namespace {

constexpr std::uint32_t slots = 4;
constexpr std::uint32_t length = 64;

struct Ring {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer writer() {
        return *Writer::create(directory.path(),
                               {"frames", StreamKind::frames, 8, slots, page_size});
    }
    Reader reader(Position start) {
        Options options;
        options.start = start;
        return std::move(*Reader::open(directory.path() / "frames", options));
    }
};

std::byte fill_of(std::uint64_t number) { return static_cast<std::byte>(number + 1); }

void publish(Writer& writer) {
    const std::uint64_t number = writer.head();
    const std::uint32_t slot = writer.acquire().value();
    std::memset(writer.slot_data(slot), std::to_integer<int>(fill_of(number)), length);
    writer.publish(slot, length, OutputTime{static_cast<std::int64_t>(number)}, {number, number});
}

/// All of it is of this item.
bool whole(const Item& item) {
    if (item.time.ns != static_cast<std::int64_t>(item.number)) return false;
    if (item.metadata[0] != item.number || item.metadata[1] != item.number) return false;
    for (std::size_t i = 0; i < item.payload.size(); ++i)
        if (item.payload.data()[i] != fill_of(item.number)) return false;
    return item.payload.size() == length;
}

struct Seen {
    std::uint64_t items = 0;
    std::uint64_t lost = 0;
    Found end = Found::nothing;  ///< what came instead of an item

    static Seen by(Reader& reader, std::uint64_t next) {
        Seen seen;
        for (;;) {
            reader.writer_alive();  // looks now, not only now and then
            const auto item = look(reader.next());
            if (item.found == Found::lost) {
                seen.lost += item.lost;
                next += item.lost;
                continue;
            }
            seen.end = item.found;
            if (item.found != Found::item) return seen;
            CHECK(item.number == next++);
            if (item.valid()) CHECK(whole(item));
            ++seen.items;
        }
    }
};

}  // namespace

TEST_CASE_METHOD(Ring,
                 "kills: at each instruction of a publication, an item is whole or not there") {
    constexpr std::uint64_t before = 6;  // all slots are in use: the next takes one from a reader
    unsigned with = 0;
    unsigned without = 0;
    for (unsigned steps = 0;; ++steps) {
        Stepped child([&] {
            Writer writer = this->writer();
            for (std::uint64_t i = 0; i < before; ++i) publish(writer);
            test::mark();
            publish(writer);
            test::mark();
        });
        Reader reader = this->reader(Position::oldest);
        const std::uint64_t oldest = look(reader.next()).number;
        CHECK(oldest == before - slots);
        const bool killed = child.kill_after(steps, Step::instruction);
        INFO("killed after " << steps << " instructions");
        const Seen seen = Seen::by(reader, oldest + 1);
        CHECK(seen.lost == 0);
        CHECK(seen.end == Found::gone);
        REQUIRE(seen.items >= before - oldest - 1);
        REQUIRE(seen.items <= before - oldest);
        ++(seen.items == before - oldest ? with : without);

        Writer next = writer();
        publish(next);
        CHECK(look(reader.next()).found == Found::restarted);
        CHECK(whole(look(reader.next())));
        if (!killed) break;
    }
    CHECK(without > 10);
    CHECK(with > 10);
}

TEST_CASE_METHOD(Ring,
                 "kills: at each system call of taking over, readers get to the next writer") {
    unsigned steps = 0;
    unsigned superseded = 0;
    for (bool killed = true; killed; ++steps) {
        auto first = std::make_unique<Stepped>([&] {
            Writer writer = this->writer();
            publish(writer);
            publish(writer);
            test::mark();
        });
        Reader reader = this->reader(Position::middle);
        first.reset();
        Stepped second([&] {
            test::mark();
            Writer writer = this->writer();
            publish(writer);
            test::mark();
        });
        killed = second.kill_after(steps, Step::system_call);
        INFO("killed after " << steps << " system calls");
        Seen seen = Seen::by(reader, 0);
        CHECK(seen.items == 2);
        if (seen.end == Found::restarted) {  // to the ring of the second one
            ++superseded;
            seen = Seen::by(reader, 0);
            CHECK(seen.items <= 1);
        }
        CHECK(seen.end == Found::gone);

        Writer third = writer();
        publish(third);
        publish(third);
        CHECK(look(reader.next()).found == Found::restarted);
        seen = Seen::by(reader, 0);
        CHECK(seen.items == 2);
        CHECK(seen.end == Found::nothing);
        CHECK(std::distance(std::filesystem::directory_iterator(directory.path()), {}) == 1);
    }
    CHECK(steps > 20);
    CHECK(superseded > 0);
}

TEST_CASE_METHOD(Ring,
                 "kills: at each system call of claiming a directory, no epoch is used twice") {
    auto* used = static_cast<std::atomic<std::uint32_t>*>(
        ::mmap(nullptr, page_size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
    REQUIRE(used != MAP_FAILED);
    std::uint32_t next = 0;
    unsigned steps = 0;
    for (bool killed = true; killed; ++steps) {
        *used = next;  // none yet
        Stepped child([&] {
            test::mark();
            auto claimed = OwnedDirectory::claim(directory.path() / "instance");
            if (!claimed) ::_exit(1);
            EpochBlock& epochs = claimed->epochs();
            for (const std::uint32_t begun : {0U, epochs_reserved / 2, epochs_reserved}) {
                epochs.keep(epochs.first() + begun);
                *used = epochs.first() + begun + 1;
            }
            test::mark();
        });
        killed = child.kill_after(steps, Step::system_call);
        INFO("killed after " << steps << " system calls");
        auto claimed = OwnedDirectory::claim(directory.path() / "instance");
        REQUIRE(claimed);
        CHECK(claimed->epochs().first() >= *used);
        claimed->epochs().keep(claimed->epochs().first());
        next = claimed->epochs().first() + 1;
    }
    CHECK(steps > 10);
    ::munmap(used, page_size);
}
