// SPDX-License-Identifier: BSD-3-Clause
// What repair saves of damaged files, held against a reader that shares nothing with it.
#include "recording/salvage.hpp"

#include <zlib.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <vector>

#include "pixel_formats.hpp"
#include "recording/recording.hpp"
#include "recording/repair.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using test::RecordingFile;

namespace {

/// A message as its topic, its number and its bytes.
using Messages = std::multiset<std::string>;

struct PlainChunk {
    std::size_t begin = 0;
    std::size_t end = 0;
    Messages messages;
};

/// Reads a file that is whole: fails where it is not.
class PlainFile {
 public:
    explicit PlainFile(const std::string& bytes) : bytes_(bytes) {
        REQUIRE(bytes.size() > 16);
        CHECK(bytes.substr(0, 8) == bytes.substr(bytes.size() - 8));
        for (std::size_t at = 8; at + 8 < bytes.size();) {
            const auto opcode = static_cast<unsigned char>(bytes[at]);
            const auto length = number<std::uint64_t>(at + 1);
            REQUIRE(length <= bytes.size() - at - 9);
            if (opcode == 6) chunk(at, length);
            if (opcode == 9) {
                const std::uint32_t size = number<std::uint32_t>(at + 25);
                attachments.insert(bytes.substr(at + 29, size));
            }
            if (opcode == 0x0B) counted = number<std::uint64_t>(at + 9);
            if (opcode == 5) FAIL("a message outside of chunks");
            at += 9 + length;
        }
    }

    Messages all() const {
        Messages messages;
        for (const PlainChunk& chunk : chunks)
            messages.insert(chunk.messages.begin(), chunk.messages.end());
        return messages;
    }

    std::vector<PlainChunk> chunks;
    std::set<std::string> attachments;
    std::uint64_t counted = 0;

 private:
    template <class T>
    T number(std::size_t at) const {
        T value{};
        REQUIRE(at + sizeof value <= bytes_.size());
        std::memcpy(&value, bytes_.data() + at, sizeof value);
        return value;
    }

    void chunk(std::size_t at, std::uint64_t length) {
        PlainChunk found{at, at + 9 + length, {}};
        const std::size_t begin = at + 9 + 16 + 8 + 4 + 4 + 8;
        REQUIRE(number<std::uint64_t>(begin - 8) == found.end - begin);
        const std::string records = bytes_.substr(begin, found.end - begin);
        const auto sum = crc32(0, reinterpret_cast<const Bytef*>(records.data()),
                               static_cast<uInt>(records.size()));
        CHECK(sum == number<std::uint32_t>(at + 9 + 24));
        for (std::size_t place = begin; place < found.end;) {
            const auto size = number<std::uint64_t>(place + 1);
            REQUIRE(size <= found.end - place - 9);
            const auto id = number<std::uint16_t>(place + 9);
            if (bytes_[place] == 4)
                topics_[id] = bytes_.substr(place + 17, number<std::uint32_t>(place + 13));
            if (bytes_[place] == 5) {
                REQUIRE(topics_.count(id) == 1);
                found.messages.insert(topics_[id] + bytes_.substr(place + 11, size - 2));
            }
            place += 9 + size;
        }
        chunks.push_back(std::move(found));
    }

    const std::string& bytes_;
    std::map<std::uint16_t, std::string> topics_;
};

std::string content_at(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

/// Four chunks, each with its channels, and an attachment.
std::string small_recording() {
    RecordingFile file;
    file.add_attachment("configuration.toml", "instance = \"test\"\n");
    for (std::uint64_t i = 0; i < 12; ++i) {
        const std::string json = R"({"schema":1,"n":)" + std::to_string(i) + "}";
        const auto* bytes = reinterpret_cast<const std::byte*>(json.data());
        file.add({"status",
                  ring::StreamKind::status,
                  i,
                  1,
                  {1'700'000'000'000'000'000 + static_cast<std::int64_t>(i)},
                  {},
                  {bytes, bytes + json.size()}});
        if (i % 3 == 2) file.end_chunk(true);
    }
    return file.finish();
}

struct SalvageSample {
    test::TemporaryDirectory directory;
    std::string path = (directory.path() / "a.mcap").string();
    std::string saved = (directory.path() / "b.mcap").string();
    std::string whole = small_recording();
    PlainFile original{whole};
    Messages all = original.all();

    /// What repair saves of `bytes`; it is never more than was there.
    std::optional<PlainFile> repaired(const std::string& bytes) {
        std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
        std::filesystem::remove(saved);
        const auto report = client::repair(path, saved);
        if (!report) return std::nullopt;
        content_ = report->was_whole ? bytes : content_at(saved);
        std::optional<PlainFile> file(std::in_place, content_);
        CHECK(file->counted == file->all().size());
        return file;
    }

    /// Of the chunks that `is_there` holds for.
    template <class IsThere>
    Messages expected(IsThere is_there) const {
        Messages messages;
        for (const PlainChunk& chunk : original.chunks)
            if (is_there(chunk)) messages.insert(chunk.messages.begin(), chunk.messages.end());
        return messages;
    }

    /// At least these, and nothing that was not there.
    void has(const PlainFile& file, const Messages& least) const {
        const Messages found = file.all();
        CHECK(std::includes(found.begin(), found.end(), least.begin(), least.end()));
        CHECK(std::includes(all.begin(), all.end(), found.begin(), found.end()));
    }

 private:
    std::string content_;
};

constexpr std::size_t header_end = 8 + 9 + 4 + 4 + 4 + 4;  ///< magic and header: "ros2", "test"

}  // namespace

TEST_CASE("salvage: a byte that is damaged costs its chunk at most") {
    SalvageSample sample;
    REQUIRE(sample.original.chunks.size() == 4);
    for (std::size_t at = 8; at < sample.whole.size(); ++at) {
        std::string bytes = sample.whole;
        bytes[at] = static_cast<char>(bytes[at] ^ 0x41);
        INFO("byte " << at);
        const auto saved = sample.repaired(bytes);
        if (!saved && at < header_end) continue;  // it is no MCAP file
        REQUIRE(saved);
        sample.has(*saved, sample.expected([&](const PlainChunk& chunk) {
            return at < chunk.begin || at >= chunk.end;
        }));
    }
}

TEST_CASE("salvage: a file that is cut at a byte has all chunks before it") {
    SalvageSample sample;
    for (std::size_t size = header_end; size < sample.whole.size(); ++size) {
        INFO("size " << size);
        const auto saved = sample.repaired(sample.whole.substr(0, size));
        if (!saved) continue;
        CHECK(saved->all() ==
              sample.expected([&](const PlainChunk& chunk) { return chunk.end <= size; }));
    }
}

TEST_CASE("salvage: of 10000 files with any damage all chunks that are there are saved") {
    SalvageSample sample;
    std::mt19937_64 random(20261128);
    const auto any = [&](std::size_t end) { return static_cast<std::size_t>(random() % end); };
    std::size_t chunks = 0;
    for (int i = 0; i < 10'000; ++i) {
        std::string bytes = sample.whole;
        for (std::size_t n = 1 + any(4); n > 0; --n) {
            const std::size_t at = header_end + any(bytes.size() - header_end);
            switch (any(4)) {
                case 0: bytes[at] = static_cast<char>(random()); break;
                case 1: bytes.resize(std::max(at, header_end + 1)); break;
                case 2: bytes.erase(at, 1 + any(64)); break;
                default: bytes.insert(at, std::string(1 + any(64), static_cast<char>(random())));
            }
            if (bytes.size() <= header_end + 1) break;
        }
        const Messages least = sample.expected([&](const PlainChunk& chunk) {
            const bool there = bytes.find(sample.whole.substr(
                                   chunk.begin, chunk.end - chunk.begin)) != std::string::npos;
            chunks += there ? 1U : 0U;
            return there;
        });
        INFO("file " << i);
        const auto saved = sample.repaired(bytes);
        if (!saved) {
            CHECK(least.empty());
            continue;
        }
        sample.has(*saved, least);
    }
    CHECK(chunks > 10'000);
}

TEST_CASE("salvage: readers pass over damage and name it, and repair keeps the old file") {
    SalvageSample sample;
    std::string bytes = sample.whole;
    const PlainChunk& damaged = sample.original.chunks[1];
    bytes[damaged.end - 3] ^= 1;
    std::ofstream(sample.path, std::ios::binary) << bytes;
    const auto recording = client::Recording::open(sample.path);
    REQUIRE(recording);
    std::vector<std::uint64_t> numbers;
    REQUIRE(recording->for_each({}, [&](const client::RecordedItem& item) {
        numbers.push_back(item.number);
        return true;
    }));
    CHECK(numbers == std::vector<std::uint64_t>{0, 1, 2, 6, 7, 8, 9, 10, 11});
    REQUIRE(recording->damages().size() == 1);
    CHECK(recording->damages()[0].find("byte " + std::to_string(damaged.begin)) !=
          std::string::npos);
    const auto report = client::repair(sample.path, "");
    REQUIRE(report);
    CHECK(report->messages == 9);
    REQUIRE(report->left_out.size() == 1);
    CHECK(report->left_out[0] == recording->damages()[0]);
    CHECK(content_at(report->old_file) == bytes);
    CHECK(client::repair(sample.path, "")->was_whole);
}

TEST_CASE("salvage: an attachment that is damaged costs only itself") {
    SalvageSample sample;
    std::string bytes = sample.whole;
    bytes[bytes.find("instance = ")] = 'I';
    std::ofstream(sample.path, std::ios::binary) << bytes;
    const auto recording = client::Recording::open(sample.path);
    REQUIRE(recording);
    CHECK(recording->attachments().empty());
    CHECK(recording->damages().size() == 1);
    CHECK(recording->streams().at(0).items == 12);
    const auto saved = sample.repaired(bytes);
    REQUIRE(saved);
    CHECK(saved->all() == sample.all);
    CHECK(saved->attachments.empty());
}

TEST_CASE("salvage: messages outside of chunks, as rosbag2's fastwrite leaves them, are indexed") {
    const auto number = [](auto value) {
        return std::string(reinterpret_cast<const char*>(&value), sizeof value);
    };
    const auto text = [&](const std::string& value) {
        return number(static_cast<std::uint32_t>(value.size())) + value;
    };
    std::string bytes("\x89MCAP0\r\n", 8);
    bytes += RecordingFile::record(1, text("ros2") + text("libmcap"));
    bytes += RecordingFile::record(3, number(std::uint16_t{1}) + text("std_msgs/msg/String") +
                                          text("ros2msg") + text("string data\n"));
    bytes += RecordingFile::record(4, number(std::uint16_t{7}) + number(std::uint16_t{1}) +
                                          text("/chatter") + text("cdr") + text(""));
    for (std::uint64_t i = 0; i < 1000; ++i)
        bytes += RecordingFile::record(5, number(std::uint16_t{7}) + number(std::uint32_t{0}) +
                                              number(1000 + i) + number(900 + i) + "hello");
    SalvageSample sample;
    const auto saved = sample.repaired(bytes + "\x05\x10");
    REQUIRE(saved);
    CHECK(saved->counted == 1000);
    CHECK(saved->all().count("/chatter" + number(std::uint32_t{0}) + number(std::uint64_t{1999}) +
                             number(std::uint64_t{1899}) + "hello") == 1);
    // One damaged record costs itself.
    std::string damaged = bytes;
    damaged[bytes.size() - 36 * 500 - 36 + 4] = '\x7F';
    const auto less = sample.repaired(damaged);
    REQUIRE(less);
    CHECK(less->counted >= 999);
}
