// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_reader.hpp"

#include <lz4frame.h>
#include <sys/resource.h>
#include <zstd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <functional>
#include <random>
#include <tuple>

#include "pixel_formats.hpp"
#include "recording/recording.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::test;
using client::McapReader;
using client::Recording;

namespace {

struct ReaderSample {
    test::TemporaryDirectory directory;
    std::string path = (directory.path() / "a.mcap").string();

    void write(const std::string& bytes) const {
        std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    }
};

/// Everything that can be asked of a file.
void read_all(const std::string& path) {
    const auto recording = Recording::open(path);
    if (!recording) {
        CHECK_FALSE(recording.error().what.empty());
        return;
    }
    std::size_t bytes = 0;
    const auto take = [&](const client::RecordedItem& item) {
        for (const std::byte one : item.payload) bytes += static_cast<std::size_t>(one);
        return true;
    };
    std::vector<client::ItemPlace> places;
    const auto note = [&](const client::RecordedItem& item) {
        if (places.size() < 20) places.push_back(item.place);
        return true;
    };
    (void)recording->for_each({}, take);
    (void)recording->glance({}, note);
    for (const auto& place : places) (void)recording->at(place, take);
    (void)recording->gaps();
}

std::string damage(std::string bytes, std::mt19937_64& random) {
    const auto any = [&](std::size_t below) { return static_cast<std::size_t>(random() % below); };
    const std::size_t hits = 1 + any(3);
    for (std::size_t hit = 0; hit < hits && !bytes.empty(); ++hit) {
        const std::size_t at = any(bytes.size());
        switch (any(5)) {
            case 0: bytes[at] = static_cast<char>(random()); break;
            case 1: bytes.resize(at); break;
            case 2: {  // a length of anything
                const std::uint64_t huge = random() >> any(64);
                std::memcpy(bytes.data() + at, &huge, std::min<std::size_t>(8, bytes.size() - at));
                break;
            }
            case 3: bytes.erase(at, 1 + any(64)); break;
            default: bytes.insert(at, std::string(1 + any(64), static_cast<char>(random())));
        }
    }
    return bytes;
}

std::string packed(const std::string& records, const std::string& compression) {
    const bool lz4 = compression == "lz4";
    std::string out(
        lz4 ? LZ4F_compressFrameBound(records.size(), nullptr) : ZSTD_compressBound(records.size()),
        '\0');
    out.resize(
        lz4 ? LZ4F_compressFrame(out.data(), out.size(), records.data(), records.size(), nullptr)
            : ZSTD_compress(out.data(), out.size(), records.data(), records.size(), 1));
    return out;
}

template <class Number>
Number number_at(const std::string& bytes, std::size_t at) {
    Number number{};
    REQUIRE(at + sizeof number <= bytes.size());
    std::memcpy(&number, bytes.data() + at, sizeof number);
    return number;
}

/// A chunk: begin, end, size, checksum, name of the compression, records.
constexpr std::size_t chunk_size_at = 16;
constexpr std::size_t chunk_compression_at = 28;

/// A recording without compression, as a program that compresses writes it, and without a summary.
/// `change` alters the content of a chunk by its number.
std::string compressed(const std::string& whole, const std::string& compression,
                       const std::function<void(std::size_t, std::string&)>& change) {
    constexpr char data_end = 15;
    std::string out = whole.substr(0, 8);
    std::size_t chunks = 0;
    for (std::size_t at = 8; whole[at] != data_end;) {
        const auto size = number_at<std::uint64_t>(whole, at + 1);
        std::string content = whole.substr(at + 9, size);
        if (whole[at] == 6) {
            REQUIRE(number_at<std::uint32_t>(content, chunk_compression_at) == 0);
            const auto bytes_of = [](auto number) {
                return std::string(reinterpret_cast<const char*>(&number), sizeof number);
            };
            const std::string records =
                packed(content.substr(chunk_compression_at + 12), compression);
            content = content.substr(0, chunk_compression_at) +
                      bytes_of(static_cast<std::uint32_t>(compression.size())) + compression +
                      bytes_of(std::uint64_t{records.size()}) + records;
            change(chunks++, content);
        }
        out += test::RecordingFile::record(static_cast<std::uint8_t>(whole[at]), content);
        at += 9 + size;
    }
    return out + test::RecordingFile::record(data_end, std::string(4, '\0')) +
           test::RecordingFile::record(2, std::string(20, '\0')) + whole.substr(0, 8);
}

using ItemSeen = std::tuple<std::string, std::uint64_t, std::int64_t, std::string>;

/// Those of a file, and what is damaged.
std::pair<std::vector<ItemSeen>, std::vector<std::string>> items_of(const std::string& path) {
    const auto recording = Recording::open(path);
    REQUIRE(recording);
    std::vector<ItemSeen> items;
    REQUIRE(recording->for_each({}, [&](const client::RecordedItem& item) {
        items.emplace_back(
            item.stream, item.number, item.time.ns,
            std::string(reinterpret_cast<const char*>(item.payload.data()), item.payload.size()));
        return true;
    }));
    return {items, recording->damages()};
}

}  // namespace

TEST_CASE("mcap_reader: chunks of lz4 and zstd are read, and a bad one costs only itself") {
    const ReaderSample sample;
    const std::string whole = test::sample_recording(1, false, false, mono8);
    sample.write(whole);
    const auto all = items_of(sample.path).first;
    REQUIRE(all.size() > 100);
    const std::string compression = GENERATE("lz4", "zstd");
    sample.write(compressed(whole, compression, [](std::size_t, std::string&) {}));
    const auto [items, damages] = items_of(sample.path);
    CHECK(damages.empty());
    CHECK(items == all);

    const std::function<void(std::string&)> wrong[] = {
        [](std::string& content) { content[content.size() / 2] ^= 1; },
        [](std::string& content) { content.back() ^= 0x55; },
        [](std::string& content) { ++content[chunk_size_at]; },
        [](std::string& content) { --content[chunk_size_at]; },
        [](std::string& content) { content.replace(chunk_size_at, 8, 8, '\x7F'); },
        [](std::string& content) { content.resize(content.size() - 8); },
    };
    for (std::size_t i = 0; i < std::size(wrong); ++i) {
        CAPTURE(compression, i);
        sample.write(compressed(whole, compression, [&](std::size_t chunk, std::string& content) {
            if (chunk == 2) wrong[i](content);
        }));
        const auto [rest, named] = items_of(sample.path);
        CHECK(rest.size() < all.size());
        CHECK(rest.size() > all.size() / 4);
        CHECK(named.size() == 1);
        auto next = all.begin();
        for (const ItemSeen& item : rest) {
            next = std::find(next, all.end(), item);
            REQUIRE(next != all.end());
        }
    }
}

TEST_CASE("mcap_reader: 10000 damaged files give errors, and take no more memory than they have",
          "[kernel]") {
    const ReaderSample sample;
    const std::string whole[] = {test::sample_recording(1, false, false, mono8),
                                 test::sample_recording(1, true, false, mono8),
                                 test::sample_recording(1, true, true, mono8)};
    std::mt19937_64 random(20261121);
    for (int i = 0; i < 10000; ++i) {
        sample.write(damage(whole[i % 3], random));
        read_all(sample.path);
    }
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    CHECK(use.ru_maxrss < 1 << 20U);  // KiB: files have 100 of them
}

TEST_CASE("mcap_reader: a file that was cut anywhere gives what is whole, in the same order") {
    const ReaderSample sample;
    const std::string whole = test::sample_recording(1, false, false, mono8);
    sample.write(whole);
    std::vector<std::pair<std::string, std::uint64_t>> all;
    const auto read = [&] {
        std::vector<std::pair<std::string, std::uint64_t>> items;
        const auto recording = Recording::open(sample.path);
        if (!recording) return items;
        REQUIRE(recording->for_each({}, [&](const client::RecordedItem& item) {
            items.emplace_back(item.stream, item.number);
            return true;
        }));
        return items;
    };
    all = read();
    REQUIRE(all.size() > 100);
    std::size_t longest = 0;
    for (std::size_t size = 0; size < whole.size(); size += 997) {
        sample.write(whole.substr(0, size));
        const auto items = read();
        CHECK(items.size() >= longest);
        CHECK(std::equal(items.begin(), items.end(), all.begin()));
        longest = items.size();
    }
    CHECK(longest > 100);
}

TEST_CASE("mcap_reader: a chunk of another checksum is passed over, and named with its place") {
    const ReaderSample sample;
    std::string bytes = test::sample_recording(1, false, false, mono8);
    sample.write(bytes);
    const auto chunk = [&] {
        const auto reader = McapReader::open(sample.path);
        REQUIRE(reader);
        CHECK(reader->defect().empty());
        return reader->chunks().at(2);
    }();
    bytes[chunk.records_offset + chunk.records_size / 2] ^= 1;
    sample.write(bytes);
    const auto recording = Recording::open(sample.path);
    REQUIRE(recording);
    std::uint64_t items = 0;
    REQUIRE(recording->for_each({}, [&](const client::RecordedItem&) { return ++items; }));
    REQUIRE(recording->damages().size() == 1);
    CHECK(recording->damages()[0].find("byte " + std::to_string(chunk.offset)) !=
          std::string::npos);
    CHECK(items > 0);
}

TEST_CASE("mcap_reader: a compressed chunk is reported with its compression") {
    const ReaderSample sample;
    std::string bytes = test::sample_recording(1, false, false, mono8);
    const std::string content = std::string(28, '\0') + std::string("\4\0\0\0brot", 8) +
                                std::string("\1\0\0\0\0\0\0\0x", 9);
    sample.write(bytes.substr(0, 8) + test::RecordingFile::record(1, std::string(8, '\0')) +
                 test::RecordingFile::record(6, content));
    const auto recording = Recording::open(sample.path);
    REQUIRE_FALSE(recording);
    CHECK(recording.error().what.find("brot") != std::string::npos);
    CHECK_FALSE(recording.error().cure.empty());
}

TEST_CASE("mcap_reader: a summary that names a place twice, or one in another, is not believed") {
    const ReaderSample sample;
    const auto number = [](std::uint64_t value) {
        return std::string(reinterpret_cast<const char*>(&value), sizeof value);
    };
    const std::string begin =
        std::string("\x89MCAP0\r\n", 8) + test::RecordingFile::record(1, std::string(8, '\0'));
    const auto attachment = [&](const std::string& content) {
        return test::RecordingFile::record(
            9, std::string(24, '\0') + number(content.size()) + content + std::string(4, '\0'));
    };
    const std::string inner = attachment("within");
    const std::string outer = attachment(inner);
    const std::string chunk = test::RecordingFile::record(
        6, std::string(28, '\0') + std::string(4, '\0') + std::string(8, '\0'));
    client::McapSummary summary;
    const auto add = [&](std::uint64_t offset, std::uint64_t length) {
        summary.attachments.push_back({offset, length, 0, 0, 0, "", ""});
    };
    const std::uint64_t at = begin.size();
    const std::uint64_t after = at + outer.size();
    SECTION("an attachment twice") {
        add(at, outer.size());
        add(at, outer.size());
    }
    SECTION("an attachment in another") {
        add(at, outer.size());
        add(after - 4 - inner.size(), inner.size());
    }
    SECTION("the other one first") {
        add(after - 4 - inner.size(), inner.size());
        add(at, outer.size());
    }
    SECTION("a chunk twice") { summary.chunks.resize(2, {0, 0, after, chunk.size(), {}, 0, 0}); }
    sample.write(begin + outer + chunk +
                 client::mcap_end(summary, begin.size() + outer.size() + chunk.size()));
    const auto reader = McapReader::open(sample.path);
    REQUIRE(reader);
    CHECK(reader->defect().find("point to the same place") != std::string::npos);
    CHECK(reader->attachments().size() == 1);
    CHECK(reader->chunks().size() == 1);
}

TEST_CASE("mcap_reader: what is no MCAP file is reported, and a directory, and nothing") {
    const ReaderSample sample;
    CHECK_FALSE(McapReader::open(sample.path));
    CHECK_FALSE(McapReader::open(sample.directory.path().string()));
    CHECK_FALSE(McapReader::open("/dev/zero"));
    for (const std::string& bytes : {std::string(), std::string("\x89MCAP0\r\n"),
                                     std::string(100, 'x'), std::string(8, '\x89')}) {
        sample.write(bytes);
        CHECK_FALSE(McapReader::open(sample.path));
    }
}
