// SPDX-License-Identifier: BSD-3-Clause
// What a writer leaves in the file, byte by byte: offsets are the document's, not the header's.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

struct Ring {
    test::TemporaryDirectory directory{"/dev/shm"};

    Writer write(const Shape& shape) { return *Writer::create(directory.path(), shape); }

    std::string bytes(const std::string& name) {
        std::ifstream file(directory.path() / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
};

template <typename T>
T layout_at(const std::string& bytes, std::size_t offset) {
    REQUIRE(bytes.size() >= offset + sizeof(T));
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}

std::uint64_t u64(const std::string& bytes, std::size_t offset) {
    return layout_at<std::uint64_t>(bytes, offset);
}
std::uint32_t u32(const std::string& bytes, std::size_t offset) {
    return layout_at<std::uint32_t>(bytes, offset);
}

/// Field 22 of what the kernel reports of this process, whose name has no space.
std::uint64_t start_of_this_process() {
    std::ifstream stat("/proc/self/stat");
    std::string word;
    for (int field = 1; field <= 22; ++field) stat >> word;
    return std::stoull(word);
}

std::string boot_id() {
    std::ifstream file("/proc/sys/kernel/random/boot_id");
    std::string text;
    file >> text;
    text.erase(std::remove(text.begin(), text.end(), '-'), text.end());
    return text;
}

std::string hexadecimal(const std::string& bytes) {
    std::string text;
    for (const char byte : bytes) {
        const auto value = static_cast<unsigned char>(byte);
        text += "0123456789abcdef"[value >> 4U];
        text += "0123456789abcdef"[value & 15U];
    }
    return text;
}

}  // namespace

TEST_CASE_METHOD(Ring, "ring_layout: the header of a ring with payloads") {
    const HostTime before = host_now();
    const Writer writer = write({"frames", StreamKind::frames, 16, 3, 5000});
    const std::string file = bytes("frames");
    CHECK(file.substr(0, 8) == "VERSAVIS");
    CHECK(u32(file, 8) == 1);
    CHECK(u32(file, 12) == 10);
    CHECK(u64(file, 168) != 0);
    struct stat space {};
    REQUIRE(::stat("/proc/self/ns/pid", &space) == 0);
    CHECK(u64(file, 176) == space.st_ino);
    REQUIRE(::stat("/proc/self/ns/time", &space) == 0);
    CHECK(u64(file, 184) == space.st_ino);
    CHECK(u64(file, 16) == file.size());
    CHECK(hexadecimal(file.substr(32, 16)) == boot_id());
    CHECK(u32(file, 48) == static_cast<std::uint32_t>(::getpid()));
    CHECK(u32(file, 52) == 1);
    CHECK(u64(file, 56) == start_of_this_process());
    CHECK(u32(file, 64) == 16);
    CHECK(u32(file, 68) == 3);
    CHECK(u64(file, 72) == 8192);
    CHECK(u64(file, 80) == 4096);
    CHECK(u64(file, 88) == 4096 + 16 * 128);
    CHECK(u64(file, 96) == 8192);
    CHECK(file.size() == 8192 + 3 * 8192);
    CHECK(file.substr(104, 64) == "frames" + std::string(58, '\0'));
    CHECK(u64(file, 256) == 0);
    CHECK(u32(file, 384) == 0);
    CHECK(u32(file, 512) == 1);
    CHECK(layout_at<std::int64_t>(file, 640) >= before.ns);
    CHECK(layout_at<std::int64_t>(file, 640) <= host_now().ns);
    CHECK(writer.slot_size() == 8192);
    CHECK(writer.slot_count() == 3);
}

TEST_CASE_METHOD(Ring, "ring_layout: a ring without payloads ends behind its descriptors") {
    const Writer writer = write({"imu", StreamKind::imu, 64});
    const std::string file = bytes("imu");
    CHECK(u32(file, 52) == 2);
    CHECK(u32(file, 68) == 0);
    CHECK(u64(file, 72) == 0);
    CHECK(u64(file, 96) == 4096 + 64 * 128);
    CHECK(file.size() == 4096 + 64 * 128);
}

TEST_CASE_METHOD(Ring, "ring_layout: slots begin on a page, behind the last generation") {
    // 31 and 32 generations of 64 bytes fill the page behind 16 descriptors, 33 do not.
    for (const auto& [slots, slots_at] :
         {std::pair{31U, 8192U}, std::pair{32U, 8192U}, std::pair{33U, 12288U}}) {
        const Writer writer = write({"frames", StreamKind::frames, 16, slots, 1});
        const std::string file = bytes("frames");
        CHECK(u64(file, 96) == slots_at);
        CHECK(u64(file, 72) == 4096);
        CHECK(file.size() == slots_at + slots * 4096U);
    }
    const Writer writer = write({"frames", StreamKind::frames, 16, 1, 4096});
    CHECK(u64(bytes("frames"), 72) == 4096);
}

TEST_CASE_METHOD(Ring, "ring_layout: each segment has a number of its own, in all its bits") {
    std::set<std::uint64_t> seen;
    std::uint64_t ones = 0;
    std::uint64_t zeros = 0;
    for (int i = 0; i < 64; ++i) {
        const Writer writer = write({"events", StreamKind::events, 8});
        const std::uint64_t generation = u64(bytes("events"), 24);
        seen.insert(generation);
        ones |= generation;
        zeros |= ~generation;
    }
    CHECK(seen.size() == 64);
    CHECK(ones == ~std::uint64_t{0});
    CHECK(zeros == ~std::uint64_t{0});
}

TEST_CASE_METHOD(Ring, "ring_layout: an item without payload, in its descriptor") {
    Writer writer = write({"events", StreamKind::events, 8, 0, 0, 9});
    CHECK(writer.head() == 9);
    Metadata metadata;
    for (std::size_t i = 0; i < metadata.size(); ++i) metadata[i] = 100 + i;
    writer.publish(OutputTime{-5}, metadata);
    const std::string file = bytes("events");
    CHECK(u32(file, 52) == 3);
    const std::size_t descriptor = 4096 + (9 % 8) * 128;
    CHECK(u64(file, descriptor) == 2 * 9 + 2);
    CHECK(u64(file, descriptor + 8) == 0);
    CHECK(u64(file, descriptor + 16) == 0xFFFFFFFF);
    CHECK(layout_at<std::int64_t>(file, descriptor + 24) == -5);
    for (std::size_t i = 0; i < 12; ++i) CHECK(u64(file, descriptor + 32 + 8 * i) == 100 + i);
    CHECK(u64(file, 256) == 10);
    CHECK(u32(file, 384) == 1);
    CHECK(writer.head() == 10);
    // Its neighbours are not complete: as before item 10, and before item 16.
    CHECK(u64(file, 4096 + 2 * 128) == 2 * (10 - 8) + 1);
    CHECK(u64(file, 4096) == 2 * (16 - 8) + 1);
}

TEST_CASE_METHOD(Ring, "ring_layout: a payload, its slot and its generation") {
    Writer writer = write({"frames", StreamKind::frames, 8, 2, 8192});
    const auto generation = [&](std::size_t slot) {
        return u64(bytes("frames"), 4096 + 8 * 128 + 64 * slot);
    };
    REQUIRE(writer.acquire() == 0U);
    REQUIRE(writer.acquire() == 1U);
    CHECK(generation(0) == 1);
    CHECK(generation(1) == 1);
    std::memset(writer.slot_data(1), 'x', 8192);
    writer.publish(1, 8192, OutputTime{7}, {}, pack(SensorState{6.5F, 41}));
    CHECK(generation(1) == 2);
    CHECK(generation(0) == 1);
    writer.abandon(0);
    CHECK(generation(0) == 2);
    const std::string file = bytes("frames");
    CHECK(layout_at<float>(file, 4096 + 8 * 128 + 64 + 8) == 6.5F);
    CHECK(layout_at<float>(file, 4096 + 8 * 128 + 64 + 12) == 41);
    CHECK(u64(file, 4096) == 2);
    CHECK(u64(file, 4096 + 8) == 2);
    CHECK(u64(file, 4096 + 16) == (8192ULL << 32U | 1));
    CHECK(layout_at<std::int64_t>(file, 4096 + 24) == 7);
    CHECK(u32(file, 384) == 1);  // giving a slot back is no news
    const std::size_t slots_at = u64(file, 96);
    CHECK(file.substr(slots_at, 8192) == std::string(8192, '\0'));
    CHECK(file.substr(slots_at + 8192, 8192) == std::string(8192, 'x'));
}

TEST_CASE_METHOD(Ring, "ring_layout: state, heartbeat and name follow the writer") {
    auto first = std::make_unique<Writer>(write({"events", StreamKind::events, 8}));
    first->heartbeat(HostTime{12345});
    CHECK(layout_at<std::int64_t>(bytes("events"), 640) == 12345);
    std::filesystem::create_hard_link(directory.path() / "events", directory.path() / "old");
    {
        const Writer second = write({"events", StreamKind::events, 8});
        CHECK(u32(bytes("old"), 512) == 3);
        CHECK(u32(bytes("old"), 384) == 1);
        first.reset();
        CHECK(u32(bytes("old"), 512) == 3);  // still
        CHECK(u32(bytes("old"), 384) == 1);
        CHECK(u32(bytes("events"), 512) == 1);
        std::filesystem::remove(directory.path() / "old");
        std::filesystem::create_hard_link(directory.path() / "events", directory.path() / "old");
    }
    CHECK(u32(bytes("old"), 512) == 2);
    CHECK(u32(bytes("old"), 384) == 1);
    CHECK_FALSE(std::filesystem::exists(directory.path() / "events"));
}

TEST_CASE_METHOD(Ring, "ring_layout: the file is for its owner and the group, and has its memory") {
    const mode_t mask = ::umask(0);
    const Writer writer = write({"frames", StreamKind::frames, 8, 4, 1 << 20});
    ::umask(mask);
    struct stat file {};
    REQUIRE(::stat((directory.path() / "frames").c_str(), &file) == 0);
    CHECK((file.st_mode & 07777U) == 0640U);
    CHECK(file.st_blocks * 512 >= file.st_size);
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(directory.path())) {
        CHECK(entry.path().filename() == "frames");
        ++files;
    }
    CHECK(files == 1);
}

TEST_CASE("ring_layout: kinds of streams have the numbers of the document") {
    CHECK(static_cast<int>(StreamKind::frames) == 1);
    CHECK(static_cast<int>(StreamKind::imu) == 2);
    CHECK(static_cast<int>(StreamKind::events) == 3);
    CHECK(static_cast<int>(StreamKind::status) == 4);
    CHECK(static_cast<int>(StreamKind::evidence) == 5);
    CHECK(static_cast<int>(StreamKind::clock) == 6);
}

TEST_CASE_METHOD(Ring, "ring_layout: names up to 63 characters") {
    const std::string longest(63, 'n');
    const Writer writer = write({longest, StreamKind::events, 8});
    CHECK(bytes(longest).substr(104, 64) == longest + '\0');
    CHECK_FALSE(Writer::create(directory.path(), {longest + 'n', StreamKind::events, 8}));
}
