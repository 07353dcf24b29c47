// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_writer.hpp"

#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>
#include <zlib.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "../support/in_process.hpp"
#include "../support/small_disk.hpp"
#include "../support/temporary_directory.hpp"
#include "recording/mcap_reader.hpp"
#include "recording/repair.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Matchers::Contains;
using test::content_of;

namespace {

std::string bytes_as_text(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Files {
    test::TemporaryDirectory directory;
    std::string path = (directory.path() / "a.mcap").string();
    std::vector<std::byte> body = std::vector<std::byte>(100'000, std::byte{7});

    McapWriter writer() {
        auto made = McapWriter::create(path, "a test");
        REQUIRE(made);
        return std::move(*made);
    }
    static std::uint16_t add(McapWriter& writer, const std::string& topic) {
        return writer.add({topic, "cdr", "Type", "ros2msg", "uint8[] data", {{"a", "b"}}});
    }

    /// Data of all messages, as far as the file is whole.
    std::vector<std::string> messages() const {
        std::vector<std::string> all;
        const auto reader = McapReader::open(path);
        if (!reader) return all;
        McapBuffer buffer;
        for (const McapChunk& chunk : reader->chunks()) {
            const auto records = reader->load(chunk, buffer);
            REQUIRE(records);
            CHECK(reader->for_each(chunk, *records, [&](const McapRecord& record) {
                if (record.opcode == McapOpcode::message)
                    all.push_back(bytes_as_text(parse_message(record.content)->data));
                return Expected<bool>(true);
            }));
        }
        return all;
    }
};

}  // namespace

TEST_CASE_METHOD(Files, "mcap_writer: what is written is read, with its indexes and summary") {
    auto writer = this->writer();
    const auto first = add(writer, "/first");
    const auto second = add(writer, "/second");
    add(writer, "/never");
    REQUIRE(writer.add_metadata("facts", {{"x", "1"}, {"y", "2"}}));
    REQUIRE(writer.attach("file", "text/plain", "content", 5));
    writer.write({first, 1, 1000}, "one");
    REQUIRE(writer.write({second, 1, 900}, "head ", body));
    writer.write({first, 2, 1100}, "two");
    CHECK(writer.chunk_size() > body.size());
    REQUIRE(writer.end_chunk());
    CHECK(writer.chunk_size() == 0);
    writer.write({second, 2, 2000}, "three");
    REQUIRE(writer.close());
    CHECK(messages() ==
          std::vector<std::string>{"one", "head " + bytes_as_text(body), "two", "three"});

    const auto reader = McapReader::open(path);
    CHECK(reader->defect().empty());
    CHECK(reader->profile() == "ros2");
    CHECK(reader->library() == "a test");
    CHECK(reader->chunks().size() == 2);
    CHECK(reader->channels().size() == 3);
    CHECK(reader->channels()[0].metadata.at("a") == "b");
    CHECK(reader->schemas().at(1).data == "uint8[] data");
    REQUIRE(reader->statistics());
    CHECK(reader->statistics()->messages == 4);
    CHECK(reader->statistics()->of_channel.at(second) == 2);
    CHECK(reader->metadata()[0].values.at("y") == "2");
    CHECK(reader->attachments()[0].content == "content");
}

TEST_CASE_METHOD(Files, "mcap_writer: a chunk's checksum is that of zlib") {
    auto writer = this->writer();
    const auto channel = add(writer, "/a");
    REQUIRE(writer.write({channel, 1, 1}, "x", body));
    REQUIRE(writer.close());
    const auto reader = McapReader::open(path);
    const McapChunk& chunk = reader->chunks()[0];
    const std::string bytes = content_of(path).substr(chunk.records_offset, chunk.records_size);
    CHECK(chunk.crc == ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uInt>(bytes.size())));
}

TEST_CASE_METHOD(Files, "mcap_writer: what is taken back is nowhere in the file") {
    auto writer = this->writer();
    const auto channel = add(writer, "/a");
    const auto other = add(writer, "/b");
    SECTION("between others") {
        writer.write({channel, 1, 10}, "before");
        REQUIRE(writer.write({other, 1, 20}, "gone", body));
        writer.take_back();
        writer.write({channel, 2, 30}, "after");
        REQUIRE(writer.close());
        CHECK(messages() == std::vector<std::string>{"before", "after"});
    }
    SECTION("alone in its chunk") {
        REQUIRE(writer.write({other, 1, 20}, "gone", body));
        writer.take_back();
        REQUIRE(writer.end_chunk());
        writer.write({other, 1, 30}, "kept");
        REQUIRE(writer.close());
        CHECK(messages() == std::vector<std::string>{"kept"});
    }
    CHECK(McapReader::open(path)->defect().empty());
    CHECK(content_of(path).size() < body.size());
    CHECK_THAT(content_of(path), !Contains("gone"));
}

TEST_CASE_METHOD(Files, "mcap_writer: a crash after a chunk finds nothing behind it") {
    auto writer = this->writer();
    const auto channel = add(writer, "/a");
    writer.write({channel, 1, 1000}, "kept");
    REQUIRE(writer.write({channel, 2, 10}, "gone", body));
    writer.take_back();
    REQUIRE(writer.end_chunk());
    CHECK(std::filesystem::file_size(path) == writer.size());
    const auto reader = McapReader::open(path);
    REQUIRE(reader);
    std::uint64_t start_time = 0;
    const std::string bytes = content_of(path);
    std::memcpy(&start_time, bytes.data() + reader->chunks()[0].offset + 9, 8);
    CHECK(start_time == 1000);
}

TEST_CASE_METHOD(Files,
                 "mcap_writer: a file that ends anywhere is good up to its last whole chunk") {
    {
        auto writer = this->writer();
        const auto channel = add(writer, "/a");
        for (int chunk = 0; chunk < 3; ++chunk) {
            REQUIRE(writer.write({channel, 1, chunk}, std::to_string(chunk), {}));
            if (chunk < 2) REQUIRE(writer.end_chunk());
        }
    }  // as if it were killed: the third is not ended
    CHECK(messages() == std::vector<std::string>{"0", "1"});
    const std::string whole = content_of(path);
    std::size_t found = 2;
    for (std::size_t size = whole.size(); size > 60; --size) {
        std::filesystem::resize_file(path, size);
        const std::size_t now = messages().size();
        CHECK(now <= found);
        found = now;
    }
    CHECK(found == 0);
}

TEST_CASE_METHOD(Files,
                 "mcap_writer: no file is overwritten, and none repaired while it is written") {
    auto writer = this->writer();
    const auto again = McapWriter::create(path, "");
    REQUIRE_FALSE(again);
    CHECK_THAT(again.error().message(), Contains("none is overwritten"));
    const auto nowhere = McapWriter::create("/nowhere/a.mcap", "");
    REQUIRE_FALSE(nowhere);
    CHECK_THAT(nowhere.error().message(), Contains("make its directory"));
    const auto repaired = repair(path, "");
    REQUIRE_FALSE(repaired);
    CHECK_THAT(repaired.error().message(), Contains("is being written by another process"));
}

TEST_CASE_METHOD(Files, "mcap_writer: a full disk costs the chunk that was open, no more") {
    CHECK(test::in_process([&] {
        ::signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{300'000, 300'000};
        ::setrlimit(RLIMIT_FSIZE, &limit);
        auto writer = McapWriter::create(path, "a test");
        const auto channel = add(*writer, "/a");
        if (!writer->write({channel, 1, 1}, "first", body) || !writer->end_chunk()) return false;
        Expected<> written;
        for (int i = 0; written && i < 5; ++i) written = writer->write({channel, 2, 2}, "x", body);
        return !written &&
               written.error().message().find("free some of the disk") != std::string::npos &&
               writer->close_before_chunk().has_value();
    }));
    CHECK(McapReader::open(path)->defect().empty());
    CHECK(messages() == std::vector<std::string>{"first" + bytes_as_text(body)});
}

TEST_CASE_METHOD(Files, "mcap_writer: a full disk has room for the summary of many small chunks") {
    const std::string disk = directory.path() / "disk";
    std::filesystem::create_directory(disk);
    const auto mounted = [&] { return test::mount_small_disk(disk, "4m"); };
    if (!test::in_process(mounted)) {
        WARN("not tested: no disk can be mounted here");
        return;
    }
    CHECK(test::in_process([&] {
        if (!mounted()) return false;
        auto writer = McapWriter::create(disk + "/a.mcap", "a test");
        const auto channel = add(*writer, "/a");
        Expected<> written;
        std::size_t chunks = 0;
        while (written && chunks < 100'000) {
            writer->write({channel, 1, 1}, "x");
            written = writer->end_chunk();
            if (written) ++chunks;
        }
        const auto closed = writer->close_before_chunk();
        const auto reader = McapReader::open(disk + "/a.mcap");
        return closed && !written && reader && reader->defect().empty() &&
               reader->chunks().size() == chunks && chunks > 1000;
    }));
}
