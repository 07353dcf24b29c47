// SPDX-License-Identifier: BSD-3-Clause
// How a ring is made, and what is left where it cannot be made.
#include "engine/ring/writer.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <deque>
#include <fstream>
#include <iterator>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/look.hpp"
#include "../support/shortage.hpp"
#include "../support/sleepers.hpp"
#include "../support/small_disk.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "client/trust.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;
using Catch::Matchers::Contains;
using test::in_process;

namespace {

const Shape events{"events", StreamKind::events, 8};
const Shape frames{"frames", StreamKind::frames, 8, 4, 1 << 20U};

struct Memory {
    test::TemporaryDirectory directory{"/dev/shm"};

    std::filesystem::path path(const std::string& name) const { return directory.path() / name; }

    /// Why there is no such ring. None of it is left.
    std::string refusal(const Shape& shape, bool sealed) const {
        const auto writer = Writer::create({directory.path(), sealed}, shape);
        if (writer) return "";
        return std::filesystem::is_empty(directory.path()) ? writer.error().message() : "left";
    }
    bool refuses(const Shape& shape, bool sealed, const std::string& why) const {
        return refusal(shape, sealed).find(why) != std::string::npos;
    }
    std::string bytes(const std::string& name) const {
        std::ifstream file(path(name), std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
};

/// A look at a descriptor when the writer comes to read metadata that lie where none can be read.
struct Look {
    const std::atomic<std::uint64_t>* sequence;
    void* page;
    std::uint64_t seen;
};
Look during_publication{};

void look_in_between(int) {
    during_publication.seen = *during_publication.sequence;
    ::mprotect(during_publication.page, page_size, PROT_READ);
}

/// Bytes that mappings of files with this in their names have as huge pages.
std::uint64_t huge_memory(const std::string& name) {
    std::ifstream maps("/proc/self/smaps");
    std::uint64_t sum = 0;
    bool own = false;
    for (std::string line; std::getline(maps, line);) {
        std::istringstream words(line);
        std::string first;
        words >> first;
        if (first.back() != ':') own = line.find(name) != std::string::npos;
        std::uint64_t kib = 0;
        if (own && first == "ShmemPmdMapped:" && words >> kib) sum += kib << 10U;
    }
    return sum;
}

bool kernel_gives_huge_pages() {
    constexpr std::size_t page = 2 << 20U;
    constexpr std::size_t size = 2 * page;
    constexpr int collapse = 25;
    void* memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    std::memset(memory, 1, size);
    const std::size_t beyond = reinterpret_cast<std::uintptr_t>(memory) % page;
    std::byte* aligned = static_cast<std::byte*>(memory) + (page - beyond) % page;
    const bool given = ::madvise(aligned, page, collapse) == 0;
    ::munmap(memory, size);
    return given;
}

std::uint64_t life_of(const std::filesystem::path& path) {
    return Mapping::open(path, Mapping::Access::read_only)->constants().life;
}

}  // namespace

TEST_CASE_METHOD(Memory, "writer: a shape needs no more than a name") {
    CHECK(Writer::create(directory.path(), {"plain"}));
    CHECK(Writer::create(directory.path(), {"single", StreamKind::events, 1}));
    CHECK_FALSE(Writer::create(directory.path(), {"none", StreamKind::events, 0}));
}

TEST_CASE_METHOD(Memory, "writer: before the first item, no descriptor says that one is there") {
    const Writer fresh = *Writer::create(directory.path(), events);
    CHECK(bytes("events").find_first_not_of('\0', page_size) == std::string::npos);
    const Writer later =
        *Writer::create(directory.path(), {"later", StreamKind::events, 8, 0, 0, 9});
    const auto mapping = Mapping::open(path("later"), Mapping::Access::read_only);
    REQUIRE(mapping);
    for (std::uint64_t number = 9; number < 17; ++number)
        CHECK(mapping->descriptor(number).sequence == 2 * (number - 8) + 1);
}

TEST_CASE_METHOD(Memory, "writer: while an item is written, its descriptor says so") {
    CHECK(in_process([&] {
        Writer writer =
            *Writer::create(directory.path(), {"later", StreamKind::events, 8, 0, 0, 9});
        const auto mapping = Mapping::open(path("later"), Mapping::Access::read_only);
        during_publication.sequence = &mapping->descriptor(9).sequence;
        during_publication.page =
            ::mmap(nullptr, page_size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        std::signal(SIGSEGV, look_in_between);
        writer.publish({}, *static_cast<const Metadata*>(during_publication.page));
        return during_publication.seen == 2 * 9 + 1 && *during_publication.sequence == 2 * 9 + 2;
    }));
}

TEST_CASE_METHOD(Memory, "writer: without history, the memory that was used last is used again") {
    Writer writer = *Writer::create(
        directory.path(), {"hot", StreamKind::frames, 4, 12, page_size, 0, 0, newest_kept});
    const unsigned ahead = GENERATE(0U, 1U, 3U);  // slots that are being filled meanwhile
    std::deque<std::uint32_t> filling;
    std::set<std::uint32_t> used;
    for (unsigned i = 0; i < ahead; ++i) filling.push_back(*writer.acquire());
    for (int i = 0; i < 50; ++i) {
        filling.push_back(*writer.acquire());
        used.insert(filling.front());
        writer.publish(filling.front(), 1, {}, {});
        filling.pop_front();
    }
    CHECK(used.size() == ahead + 1 + newest_kept);
    const std::uint32_t slot = *writer.acquire();
    writer.abandon(slot);
    CHECK(writer.acquire() == slot);
}

TEST_CASE_METHOD(Memory, "writer: without history, readers have the newest items whole") {
    constexpr std::uint32_t slots = 8;
    std::mt19937 random(GENERATE(range(1U, 9U)));
    Writer writer = *Writer::create(
        directory.path(), {"hot", StreamKind::frames, descriptors_of_kept(newest_kept), slots,
                           page_size, 0, 0, newest_kept});
    std::vector<std::uint32_t> filling;
    unsigned published = 0;
    for (int i = 0; i < 2000; ++i) {
        if (filling.size() < slots - newest_kept && random() % 2 == 0) {
            filling.push_back(*writer.acquire());
            std::memset(writer.slot_data(filling.back()), 0xFF, page_size);
        } else if (!filling.empty()) {
            const auto which = filling.begin() + random() % filling.size();
            const std::uint32_t slot = *which;
            filling.erase(which);
            if (random() % 4 == 0) {
                writer.abandon(slot);
            } else {
                std::memcpy(writer.slot_data(slot), &published, sizeof published);
                writer.publish(slot, sizeof published, {static_cast<std::int64_t>(published)}, {});
                ++published;
            }
        }
        auto reader = Reader::open(path("hot"), {Position::oldest});
        unsigned read = 0;
        for (auto item = test::look(reader->next()); item.found != test::Found::nothing; ++read) {
            REQUIRE(item.found == test::Found::item);
            std::uint32_t content = 0;
            REQUIRE(item.payload.copy_to(reinterpret_cast<std::byte*>(&content)));
            REQUIRE(content == item.time.ns);
            item = test::look(reader->next());
            REQUIRE((item.found == test::Found::item) == (content + 1 < published));
        }
        REQUIRE(read >= std::min(published, newest_kept));
    }
    REQUIRE(published > 100);
}

TEST_CASE_METHOD(Memory, "writer: without history, who comes late loses all but the newest") {
    Writer writer = *Writer::create(directory.path(),
                                    {"hot", StreamKind::frames, descriptors_of_kept(newest_kept), 8,
                                     page_size, 0, 0, newest_kept});
    auto reader = Reader::open(path("hot"), {Position::next});
    const std::uint64_t count = GENERATE(4U, 5U, 50U);
    for (std::uint64_t i = 0; i < count; ++i) writer.publish(*writer.acquire(), 1, {}, {});
    std::uint64_t lost = 0;
    std::uint64_t read = 0;
    for (auto item = test::look(reader->next()); item.found != test::Found::nothing;
         item = test::look(reader->next())) {
        lost += item.lost;
        if (item.found == test::Found::item) ++read;
    }
    CHECK(read == newest_kept);
    CHECK(lost == count - newest_kept);
}

TEST_CASE_METHOD(Memory, "writer: large rings have huge pages, if the kernel gives them",
                 "[kernel]") {
    constexpr std::uint64_t slot = 3 << 20U;
    const bool sealed = GENERATE(false, true);
    const auto writer =
        Writer::create({directory.path(), sealed}, {"large", StreamKind::frames, 8, 8, slot});
    REQUIRE(writer);
    const std::uint64_t of_writer = huge_memory("large");
    const auto reader = Reader::open(path("large"));
    REQUIRE(reader);
    CHECK(huge_memory("large") == 2 * of_writer);
    if (kernel_gives_huge_pages()) CHECK(of_writer > 0);  // of some memory it may have none
}

TEST_CASE_METHOD(Memory, "writer: what lies under its temporary name is not used") {
    const bool is_link = GENERATE(true, false);
    if (is_link)
        std::filesystem::create_symlink("victim", path(".events.new"));
    else
        std::filesystem::create_hard_link(directory.write("victim", "own"), path(".events.new"));
    const auto writer = Writer::create(directory.path(), events);
    REQUIRE(writer);
    CHECK(std::filesystem::is_regular_file(std::filesystem::symlink_status(path("events"))));
    CHECK(bytes("victim") == (is_link ? "" : "own"));
    CHECK_FALSE(std::filesystem::exists(path(".events.new")));
}

TEST_CASE_METHOD(Memory, "writer: the group may read its file, whatever the umask") {
    const mode_t mask = ::umask(0777);
    const auto writer = Writer::create(directory.path(), events);
    ::umask(mask);
    REQUIRE(writer);
    struct stat file {};
    REQUIRE(::stat(path("events").c_str(), &file) == 0);
    CHECK((file.st_mode & 07777U) == 0640U);
}

TEST_CASE_METHOD(Memory, "writer: its memory is at hand before the first payload", "[kernel]") {
    const bool sealed = GENERATE(false, true);
    Writer writer = *Writer::create({directory.path(), sealed}, frames);
    std::byte* data = writer.slot_data(0);
    const std::size_t pages = writer.slot_size() / page_size;
    rusage before{};
    rusage after{};
    REQUIRE(::getrusage(RUSAGE_THREAD, &before) == 0);
    for (std::size_t page = 0; page < pages; ++page) data[page * page_size] = std::byte{1};
    REQUIRE(::getrusage(RUSAGE_THREAD, &after) == 0);
    CHECK(after.ru_minflt - before.ru_minflt < static_cast<long>(pages / 2));
}

TEST_CASE_METHOD(Memory, "writer: all who sleep are woken by an item, and by a successor") {
    Writer writer = *Writer::create(directory.path(), events);
    const auto mapping = Mapping::open(path("events"), Mapping::Access::read_write);
    REQUIRE(mapping);
    {
        const test::Sleepers readers(mapping->header().wake, 2);
        writer.publish({}, {});
        readers.wait_until_all_are_woken();
    }
    const test::Sleepers readers(mapping->header().wake, 2);
    const Writer next = *Writer::create(directory.path(), events);
    readers.wait_until_all_are_woken();
}

TEST_CASE_METHOD(Memory, "writer: all rings of a process are of one life, those of others not") {
    const Writer one = *Writer::create(directory.path(), events);
    const Writer two = *Writer::create(directory.path(), frames);
    const std::uint64_t life = life_of(path("events"));
    CHECK(life_of(path("frames")) == life);
    CHECK(in_process([&] {
        const Writer other = *Writer::create(directory.path(), {"other", StreamKind::events, 8});
        return life_of(path("other")) != life;
    }));
    const Writer given =
        *Writer::create(directory.path(), {"given", StreamKind::events, 8, 0, 0, 0, 1});
    CHECK(life_of(path("given")) == 1);
}

TEST_CASE_METHOD(Memory, "writer: where it would lie decides whether there is room for it") {
    const Shape huge{"huge", StreamKind::frames, 8, 1024, std::uint64_t{1} << 40U};
    CHECK_THAT(refusal(huge, false), Contains("free in its file system"));
    CHECK_THAT(refusal(huge, true), Contains("free in this machine's memory"));
}

TEST_CASE_METHOD(Memory, "writer: where files may not be so large, it says so") {
    const bool sealed = GENERATE(false, true);
    const test::SmallFiles limited(1 << 20U);
    CHECK_THAT(refusal(frames, sealed), Contains("cannot reserve 4 MiB: File too large"));
}

TEST_CASE_METHOD(Memory, "writer: where there is no descriptor, it says so") {
    const bool sealed = GENERATE(false, true);
    CHECK(in_process([&] {
        const auto create = [&] { return Writer::create({directory.path(), sealed}, events); };
        const auto writer = [&] {
            const test::NoDescriptors none;
            return create();
        }();
        return !writer && std::filesystem::is_empty(directory.path()) &&
               writer.error().message().find("cannot be created: Too many open files") !=
                   std::string::npos;
    }));
}

TEST_CASE_METHOD(Memory, "writer: a sealed one without a thread is not made") {
    const test::NoThreads none;
    CHECK_THAT(refusal(events, true), Contains("cannot start a thread"));
}

TEST_CASE_METHOD(Memory, "writer: where nothing can be sealed, it says what to do", "[kernel]") {
    CHECK(in_process([&] {
        return test::refuse(SYS_fcntl, EINVAL, F_ADD_SEALS) &&
               refuses(events, true, "cannot be sealed: Invalid argument; set 'sealed = false'");
    }));
}

TEST_CASE_METHOD(Memory, "writer: a sealed one is no program, unless Linux is too old for that",
                 "[kernel]") {
    constexpr unsigned no_program = 0x8;  // MFD_NOEXEC_SEAL
    const auto executable = [&] {
        const auto writer = Writer::create({directory.path(), true}, events);
        struct stat file {};
        const auto handed = open_trusted(path("events"), std::nullopt);
        return !writer || !handed || ::fstat(handed->file.get(), &file) != 0 ||
               (file.st_mode & 0111U) != 0;
    };
    if (FileDescriptor(::memfd_create("new", MFD_CLOEXEC | no_program))) CHECK_FALSE(executable());
    CHECK(in_process([&] {
        return test::refuse(SYS_memfd_create, EINVAL,
                            MFD_CLOEXEC | MFD_ALLOW_SEALING | no_program) &&
               Writer::create({directory.path(), true}, events);
    }));
}

TEST_CASE_METHOD(Memory, "writer: programs that the service starts get no descriptor of a ring") {
    const bool sealed = GENERATE(false, true);
    const auto writer = Writer::create({directory.path(), sealed}, events);
    REQUIRE(writer);
    for (const auto& file : std::filesystem::directory_iterator("/proc/self/fd")) {
        const auto target = std::filesystem::read_symlink(file.path()).string();
        if (target.find("events") == std::string::npos) continue;
        CHECK((::fcntl(std::stoi(file.path().filename()), F_GETFD) & FD_CLOEXEC) != 0);
    }
}

TEST_CASE_METHOD(Memory, "writer: only what the dead have left gives way to a new ring") {
    const auto mounted = [&] { return test::mount_small_disk(directory.path(), "7m"); };
    if (!in_process(mounted)) {
        WARN("not tested: the machine lets no process mount a file system of its own");
        return;
    }
    CHECK(in_process([&] {
        if (!mounted()) return false;
        Writer own = *Writer::create(directory.path(), {"own", StreamKind::frames, 8, 1, 1 << 20U});
        own.slot_data(0)[0] = std::byte{7};
        directory.write("note", "no ring");
        const bool left = in_process([&]() -> bool {
            const auto dead =
                Writer::create(directory.path(), {"dead", StreamKind::frames, 8, 4, 1 << 20U});
            ::_exit(dead ? 0 : 1);
        });
        const auto writer = Writer::create(directory.path(), frames);
        return left && writer && own.slot_data(0)[0] == std::byte{7} && bytes("note") == "no ring";
    }));
}

TEST_CASE_METHOD(Memory, "writer: a ring whose successor gets no name goes on", "[kernel]") {
    std::filesystem::create_directory(path("taken"));
    CHECK_THAT(Writer::create(directory.path(), {"taken", StreamKind::events, 8}).error().message(),
               Contains("cannot be renamed into place: Is a directory"));
    CHECK(in_process([&] {
        Writer writer = *Writer::create(directory.path(), events);
        auto reader = Reader::open(path("events"));
#ifdef SYS_rename
        const bool refused = test::refuse(SYS_rename, EIO);
#else
        const bool refused = test::refuse(SYS_renameat, EIO);
#endif
        if (!reader || !refused) return false;
        const auto next = Writer::create(directory.path(), events);
        if (next || next.error().message().find("cannot be renamed into place: Input/output") ==
                        std::string::npos)
            return false;
        writer.publish({}, {});
        return reader->writer_alive() && test::look(reader->next()).found == test::Found::item &&
               !std::filesystem::exists(path(".events.new"));
    }));
}
