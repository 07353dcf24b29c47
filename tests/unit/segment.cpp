// SPDX-License-Identifier: BSD-3-Clause
#include "client/segment.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <fstream>

#include "../support/temporary_directory.hpp"
#include "client/process.hpp"
#include "engine/ring/ending.hpp"
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
        const auto path = directory.path() / "changed";
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
constexpr std::uint64_t total = 4 * page_size;

}  // namespace

TEST_CASE_METHOD(Copies,
                 "segment: a whole one is mapped, and its parts lie where its header says") {
    const auto mapping = Mapping::open(directory.path() / "frames", Mapping::Access::read_write);
    REQUIRE(mapping);
    CHECK(mapping->size() == total);
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

TEST_CASE_METHOD(Copies, "segment: a size that is not the file's is refused") {
    CHECK(opens_with(offsetof(Header, total_size), total));
    CHECK_FALSE(opens_with(offsetof(Header, total_size), total - 1));
    CHECK_FALSE(opens_with(offsetof(Header, total_size), total + 1));
    const auto path = changed(offsetof(Header, total_size), total);
    std::filesystem::resize_file(path, total - page_size);
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
         {std::uint64_t{768}, std::uint64_t{4096}, total - std::uint64_t{16} * 128})
        CHECK(opens_with(place, good));
    for (const std::uint64_t bad : {std::uint64_t{0}, std::uint64_t{640}, std::uint64_t{4096 + 64},
                                    total - 15 * 128, total, total + 128, ~std::uint64_t{127}})
        CHECK_FALSE(opens_with(place, bad));
    CHECK(sizeof(Header) == 768);
}

TEST_CASE_METHOD(Copies, "segment: generations and slots are aligned, and within the file") {
    const std::size_t generations = offsetof(Header, generations_at);
    CHECK(opens_with(generations, total - 2 * 64));
    for (const std::uint64_t bad :
         {total - 64, total, std::uint64_t{4096 + 32}, ~std::uint64_t{63}})
        CHECK_FALSE(opens_with(generations, bad));
    const std::size_t slots = offsetof(Header, slots_at);
    CHECK(opens_with(slots, std::uint64_t{4096}));
    for (const std::uint64_t bad :
         {std::uint64_t{12288}, std::uint64_t{8192 + 64}, total, ~std::uint64_t{4095}})
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
    for (const std::uint32_t version : {0U, 2U})
        CHECK_FALSE(opens_with(offsetof(Header, abi_major), version));
    CHECK(opens_with(offsetof(Header, abi_minor), 77U));
}

TEST_CASE_METHOD(Copies, "segment: what cannot be mapped says why, and what to do") {
    const auto missing = Mapping::open(directory.path() / "none", Mapping::Access::read_only);
    REQUIRE_FALSE(missing);
    CHECK_THAT(missing.error().message(),
               Catch::Contains("cannot be opened") && Catch::Contains("is the service running?"));
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
