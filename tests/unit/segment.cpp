// SPDX-License-Identifier: BSD-3-Clause
#include "client/segment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/shortage.hpp"
#include "../support/temporary_directory.hpp"
#include "client/process.hpp"
#include "engine/ring/segment_lifecycle.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/time.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct Copies {
    test::TemporaryDirectory directory{"/dev/shm"};
    Writer writer =
        *Writer::create(directory.path(), {"frames", StreamKind::frames, 16, 2, page_size});

    /// A copy of the ring with one number of its header changed.
    template <typename T>
    std::filesystem::path changed(std::size_t offset, T value) {
        auto path = directory.path() / "changed";
        std::filesystem::copy_file(directory.path() / "frames", path,
                                   std::filesystem::copy_options::overwrite_existing);
        std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(static_cast<std::streamoff>(offset))
            .write(reinterpret_cast<const char*>(&value), sizeof value);
        return path;
    }

    static bool opens(const std::filesystem::path& path) {
        return Mapping::open(path, Mapping::Access::read_only).has_value();
    }
    bool opens_with(std::size_t offset, std::uint64_t value) {
        return opens(changed(offset, value));
    }
    bool opens_with(std::size_t offset, std::uint32_t value) {
        return opens(changed(offset, value));
    }
};

/// Bytes of the ring above: 16 descriptors behind the header, two generations, two slots.
constexpr std::uint64_t segment_size = 4 * page_size;

/// From here on, this process runs on a Linux before 5.14.
bool forget_to_populate() { return test::refuse(SYS_madvise, EINVAL); }

/// How many of its pages are touched without waiting.
std::size_t pages_at_hand(const Mapping& mapping) {
    const FileDescriptor map(::open("/proc/self/pagemap", O_RDONLY | O_CLOEXEC));
    std::vector<std::uint64_t> pages(mapping.size() / page_size);
    const auto first = reinterpret_cast<std::uintptr_t>(&mapping.header()) / page_size;
    const auto size = static_cast<ssize_t>(pages.size() * sizeof pages[0]);
    if (::pread(map.get(), pages.data(), static_cast<std::size_t>(size),
                static_cast<off_t>(first * sizeof pages[0])) != size)
        return 0;
    return static_cast<std::size_t>(std::count_if(
        pages.begin(), pages.end(), [](std::uint64_t page) { return page >> 63U == 1; }));
}

}  // namespace

TEST_CASE_METHOD(Copies,
                 "segment: a whole one is mapped, and its parts lie where its header says") {
    const auto mapping = Mapping::open(directory.path() / "frames", Mapping::Access::read_write);
    REQUIRE(mapping);
    CHECK(mapping->size() == segment_size);
    const auto* begin = reinterpret_cast<const std::byte*>(&mapping->header());
    const auto offset = [&](const void* part) {
        return static_cast<const std::byte*>(part) - begin;
    };
    CHECK(offset(&mapping->descriptor(0)) == 4096);
    CHECK(offset(&mapping->descriptor(15)) == 4096 + 15 * 128);
    CHECK(offset(&mapping->descriptor(16)) == 4096);
    CHECK(offset(&mapping->generation(1)) == 4096 + 16 * 128 + 64);
    CHECK(offset(mapping->slot(0)) == 8192);
    CHECK(offset(mapping->slot(1)) == 12288);
    CHECK(is_own(mapping->constants()));
}

TEST_CASE_METHOD(Copies, "segment: what its header says is read once") {
    const auto mapping = Mapping::open(directory.path() / "frames", Mapping::Access::read_write);
    REQUIRE(mapping);
    Header& header = mapping->header();
    const Constants& constants = mapping->constants();
    const std::uint64_t generation = header.generation;
    CHECK(constants.generation == generation);
    CHECK(constants.kind == StreamKind::frames);
    CHECK(constants.slot_count == 2);
    CHECK(constants.name.data() == std::string("frames"));
    CHECK(constants.life == header.life);
    CHECK(constants.pid_namespace == header.pid_namespace);
    ++header.generation;
    CHECK(constants.generation == generation);
}

TEST_CASE_METHOD(Copies,
                 "segment: one that is older than life, namespaces and attributes has none") {
    const auto path = directory.path() / "changed";
    for (const std::uint32_t minor : {4U, 5U, 6U, 7U, 8U}) {
        changed(offsetof(Header, abi_minor), minor);
        const auto mapping = Mapping::open(path, Mapping::Access::read_only);
        REQUIRE(mapping);
        CHECK((mapping->constants().life != 0) == (minor >= 5));
        CHECK((mapping->constants().pid_namespace != 0) == (minor >= 5));
        CHECK(mapping->constants().has_attributes == (minor >= 6));
        CHECK((mapping->constants().time_namespace != 0) == (minor >= 8));
    }
}

TEST_CASE_METHOD(Copies, "segment: it is known by the file that has its name") {
    const auto path = directory.path() / "frames";
    const auto mapping = Mapping::open(path, Mapping::Access::read_only);
    REQUIRE(mapping);
    struct stat file {};
    REQUIRE(::stat(path.c_str(), &file) == 0);
    CHECK(mapping->name() == FileId{file.st_dev, file.st_ino});
    CHECK(file_id(path) == mapping->name());
    std::filesystem::create_symlink("frames", directory.path() / "link");
    CHECK(file_id(directory.path() / "link") != mapping->name());
    CHECK(file_id(directory.path() / "none") == FileId{});
}

TEST_CASE_METHOD(Copies, "segment: who only reads needs no right to write") {
    const auto path = directory.path() / "frames";
    REQUIRE(::chmod(directory.path().c_str(), 0755) == 0);
    REQUIRE(::chmod(path.c_str(), 0444) == 0);
    CHECK(test::in_process([&] {
        if (::geteuid() == 0 && ::seteuid(12345) != 0) return false;
        return opens(path) && !Mapping::open(path, Mapping::Access::read_write);
    }));
}

TEST_CASE("segment: all pages are at hand, also where the kernel must be asked for each",
          "[kernel]") {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto writer =
        *Writer::create(directory.path(), {"frames", StreamKind::frames, 16, 200, page_size});
    const auto access = GENERATE(Mapping::Access::read_only, Mapping::Access::read_write);
    // A gap of its size, behind which nobody may read.
    const auto size = std::filesystem::file_size(directory.path() / "frames");
    void* gap = ::mmap(nullptr, size + page_size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    REQUIRE(::munmap(gap, size) == 0);
    const auto mapping = *Mapping::open(directory.path() / "frames", access);
    if (&mapping.header() != gap) WARN("not tested: what lies behind the last page");
    CHECK(pages_at_hand(mapping) < 200);
    CHECK(test::in_process([&] {
        if (!forget_to_populate()) return false;
        return mapping.populate("frames") && pages_at_hand(mapping) == mapping.size() / page_size;
    }));
    CHECK(mapping.populate("frames"));
    CHECK(pages_at_hand(mapping) == mapping.size() / page_size);
    ::munmap(static_cast<std::byte*>(gap) + size, page_size);
}

TEST_CASE_METHOD(Copies, "segment: no page is touched that the kernel cannot have at hand",
                 "[kernel]") {
    const auto mapping = *Mapping::open(directory.path() / "frames", Mapping::Access::read_only);
    CHECK(test::in_process([&] {
        const std::size_t before = pages_at_hand(mapping);
        if (!test::refuse(SYS_madvise, EFAULT)) return false;
        const auto populated = mapping.populate("frames");
        return !populated && pages_at_hand(mapping) == before &&
               populated.error().message() ==
                   "frames: its memory cannot be mapped: Bad address; free memory: 'df /dev/shm' "
                   "and 'free' show what there is";
    }));
    CHECK(test::in_process([&] {
        if (!test::refuse(SYS_madvise, EFAULT)) return false;
        const auto made = Writer::create(directory.path(), {"more", StreamKind::events, 8});
        return !made && !std::filesystem::exists(directory.path() / ".more.new");
    }));
}

TEST_CASE("segment: a file closes with its owner, whatever its number") {
    CHECK_FALSE(FileDescriptor());
    CHECK(test::in_process([] {
        ::close(0);
        {
            FileDescriptor zero(::open("/dev/null", O_RDONLY | O_CLOEXEC));
            if (!zero || zero.get() != 0) return false;
            const FileDescriptor moved(std::move(zero));
            if (zero || moved.get() != 0) return false;  // NOLINT: what is left is none
        }
        return ::fcntl(0, F_GETFD) == -1 && ::fcntl(1, F_GETFD) != -1;
    }));
}

TEST_CASE_METHOD(Copies, "segment: a size that is not the file's is refused") {
    CHECK(opens_with(offsetof(Header, total_size), segment_size));
    CHECK_FALSE(opens_with(offsetof(Header, total_size), segment_size - 1));
    CHECK_FALSE(opens_with(offsetof(Header, total_size), segment_size + 1));
    const auto path = changed(offsetof(Header, total_size), segment_size);
    std::filesystem::resize_file(path, segment_size - page_size);
    CHECK_FALSE(opens(path));
    const auto refusal = [&] {
        return Mapping::open(path, Mapping::Access::read_only).error().message();
    };
    std::filesystem::resize_file(path, page_size);
    CHECK_THAT(refusal(), Catch::Contains("damaged header"));
    std::filesystem::resize_file(path, page_size - 1);
    CHECK_THAT(refusal(), Catch::Contains("is not a VersaVIS ring"));
}

TEST_CASE_METHOD(Copies, "segment: descriptors are a power of two, aligned, and within the file") {
    const std::size_t count = offsetof(Header, descriptor_count);
    for (const std::uint32_t good : {1U, 2U, 8U, 16U, 64U}) CHECK(opens_with(count, good));
    for (const std::uint32_t bad : {0U, 3U, 12U, 15U, 17U, 128U, 0x80000000U, 0xFFFFFFFFU})
        CHECK_FALSE(opens_with(count, bad));
    const std::size_t place = offsetof(Header, descriptors_at);
    for (const std::uint64_t good :
         {std::uint64_t{768}, std::uint64_t{4096}, segment_size - std::uint64_t{16} * 128})
        CHECK(opens_with(place, good));
    for (const std::uint64_t bad :
         {std::uint64_t{0}, std::uint64_t{640}, std::uint64_t{4096 + 64}, segment_size - 15 * 128,
          segment_size, segment_size + 128, ~std::uint64_t{127}})
        CHECK_FALSE(opens_with(place, bad));
    CHECK(sizeof(Header) == 768);
}

TEST_CASE_METHOD(Copies, "segment: generations and slots are aligned, and within the file") {
    const std::size_t generations = offsetof(Header, generations_at);
    CHECK(opens_with(generations, segment_size - 2 * 64));
    for (const std::uint64_t bad :
         {segment_size - 64, segment_size, std::uint64_t{4096 + 32}, ~std::uint64_t{63}})
        CHECK_FALSE(opens_with(generations, bad));
    const std::size_t slots = offsetof(Header, slots_at);
    CHECK(opens_with(slots, std::uint64_t{4096}));
    for (const std::uint64_t bad :
         {std::uint64_t{12288}, std::uint64_t{8192 + 64}, segment_size, ~std::uint64_t{4095}})
        CHECK_FALSE(opens_with(slots, bad));
    const std::size_t count = offsetof(Header, slot_count);
    CHECK(opens_with(count, 0U));
    for (const std::uint32_t bad : {3U, 0xFFFFFFFFU}) CHECK_FALSE(opens_with(count, bad));
    const std::size_t size = offsetof(Header, slot_size);
    CHECK(opens_with(size, std::uint64_t{0}));
    for (const std::uint64_t bad :
         {std::uint64_t{2048}, std::uint64_t{4097}, std::uint64_t{8192}, std::uint64_t{1} << 63U})
        CHECK_FALSE(opens_with(size, bad));
}

TEST_CASE_METHOD(Copies, "segment: a name has an end, the magic is whole, the layout is known") {
    CHECK_FALSE(opens(changed(offsetof(Header, name) + 63, 'x')));
    CHECK(opens(changed(offsetof(Header, name) + 62, 'x')));
    CHECK_FALSE(opens(changed(0, 'v')));
    CHECK_FALSE(opens(changed(7, 's')));
    for (const std::uint32_t version : {0U, 2U}) {
        const auto path = changed(offsetof(Header, abi_major), version);
        const auto refused = Mapping::open(path, Mapping::Access::read_only);
        REQUIRE_FALSE(refused);
        CHECK_THAT(refused.error().message(),
                   Catch::Contains("layout version " + std::to_string(version)) &&
                       Catch::Contains("reads version 1"));
    }
    CHECK(opens_with(offsetof(Header, abi_minor), 77U));
}

TEST_CASE_METHOD(Copies, "segment: what cannot be mapped says why, and what to do") {
    const auto missing = Mapping::open(directory.path() / "none", Mapping::Access::read_only);
    REQUIRE_FALSE(missing);
    CHECK_THAT(missing.error().message(),
               Catch::Contains("cannot be opened") && Catch::Contains("is the service running?"));
    const auto message = [&](const char* name) {
        return Mapping::open(directory.path() / name, Mapping::Access::read_only).error().message();
    };
    directory.write("empty", "");
    CHECK_THAT(message("empty"),
               Catch::Contains("cannot be mapped") && Catch::Contains("is the service running?"));
    std::filesystem::create_symlink("frames", directory.path() / "link");
    CHECK_THAT(message("link"), Catch::Contains("cannot be opened"));
    REQUIRE(::mkfifo((directory.path() / "pipe").c_str(), 0600) == 0);
    CHECK_THAT(message("pipe"), Catch::Contains("is not a VersaVIS ring"));
}

TEST_CASE_METHOD(Copies, "segment: one that ends says so, and has news for who waits") {
    const auto mapping = Mapping::open(directory.path() / "frames", Mapping::Access::read_write);
    REQUIRE(mapping);
    const std::uint32_t wake = mapping->header().wake;
    supersede(mapping->header());
    CHECK(mapping->header().state == 3);
    CHECK(mapping->header().wake == wake);
    end(mapping->header());
    CHECK(mapping->header().state == 2);
    CHECK(mapping->header().wake == wake + 1);
}
