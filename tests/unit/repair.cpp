// SPDX-License-Identifier: BSD-3-Clause
#include "recording/repair.hpp"

#include <sys/file.h>

#include <fcntl.h>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "pixel_formats.hpp"
#include "posix/file_descriptor.hpp"
#include "recording/mcap_reader.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::test;
using client::repair;

namespace {

struct RepairSample {
    test::TemporaryDirectory directory;
    std::string path = (directory.path() / "a.mcap").string();

    explicit RepairSample(const std::string& bytes) { write(bytes); }
    void write(const std::string& bytes) const {
        std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    }
};

}  // namespace

TEST_CASE("repair: a file that was cut off behind a chunk is as if it had been closed there") {
    test::RecordingFile file;
    for (std::uint64_t i = 0; i < 10; ++i) {
        file.add(
            {"imu0", ring::StreamKind::imu, i, 1, {100 + static_cast<std::int64_t>(i)}, {}, {}});
        file.add({"events", ring::StreamKind::events, i, 1, {90}, {}, {}});
        if (i % 3 == 2) file.end_chunk();
    }
    file.end_chunk();
    const std::string cut = file.cut();
    const std::string whole = file.finish();
    const std::string tail =
        GENERATE(std::string(), std::string("\x06half a chunk"), std::string(5000, '\0'));
    const RepairSample sample(cut + tail);
    const auto repaired = repair(sample.path, "");
    REQUIRE(repaired);
    CHECK(content_of(sample.path) == whole);
    CHECK(repaired->messages == 20);
    CHECK(repaired->cut_bytes == tail.size());
    CHECK(repaired->cut_file.empty() == tail.empty());
    if (!tail.empty()) CHECK(content_of(repaired->cut_file) == tail);
    CHECK(repair(sample.path, "")->was_whole);
}

TEST_CASE("repair: cut anywhere, it is whole afterwards, and a new file is the same") {
    const std::string whole = test::sample_recording(1, false, false, mono8);
    const RepairSample sample(whole);
    for (std::size_t size = 1000; size < whole.size(); size += 1511) {
        sample.write(whole.substr(0, size));
        const std::string output = sample.path + ".new";
        std::filesystem::remove(output);
        std::filesystem::remove(sample.path + ".cut");
        const auto copied = repair(sample.path, output);
        REQUIRE(copied);
        CHECK(content_of(sample.path) == whole.substr(0, size));
        REQUIRE(repair(sample.path, ""));
        CHECK(content_of(sample.path) == content_of(output));
        const auto reader = client::McapReader::open(output);
        REQUIRE(reader);
        CHECK(reader->defect().empty());
        CHECK(reader->statistics()->messages == copied->messages);
    }
}

TEST_CASE("repair: a file that is being written is left alone, and so is what lies there already") {
    const RepairSample sample(test::sample_recording(1, false, true, mono8));
    const std::string before = content_of(sample.path);
    {
        const FileDescriptor recorder(::open(sample.path.c_str(), O_RDWR | O_CLOEXEC));
        REQUIRE(::flock(recorder.get(), LOCK_EX | LOCK_NB) == 0);
        CHECK_FALSE(repair(sample.path, ""));
        CHECK_FALSE(repair(sample.path, sample.path + ".new"));
    }
    std::ofstream(sample.path + ".cut") << "kept";
    CHECK_FALSE(repair(sample.path, ""));
    std::ofstream(sample.path + ".new") << "kept";
    CHECK_FALSE(repair(sample.path, sample.path + ".new"));
    CHECK(content_of(sample.path) == before);
    CHECK(content_of(sample.path + ".cut") == "kept");
    CHECK(content_of(sample.path + ".new") == "kept");
}

TEST_CASE("repair: asked to, it cuts at the first chunk that is damaged, and keeps the rest") {
    std::string bytes = test::sample_recording(1, false, GENERATE(true, false), mono8);
    RepairSample sample(bytes);
    const auto chunks = client::McapReader::open(sample.path)->chunks();
    bytes[chunks.at(2).records_offset + 100] ^= 4;
    bytes[chunks.at(3).records_offset + 100] ^= 4;
    sample.write(bytes);
    const std::string output = sample.path + ".new";
    const auto copied = repair(sample.path, output, true);
    REQUIRE(copied);
    CHECK(content_of(sample.path) == bytes);
    const auto cut = repair(sample.path, "", true);
    REQUIRE(cut);
    CHECK(content_of(sample.path) == content_of(output));
    CHECK(cut->chunks == 2);
    CHECK(cut->defect.find(std::to_string(chunks.at(2).offset)) != std::string::npos);
    CHECK(content_of(sample.path).substr(0, chunks.at(2).offset) + content_of(cut->cut_file) ==
          bytes);
    const auto reader = client::McapReader::open(sample.path);
    REQUIRE(reader);
    CHECK(reader->defect().empty());
    CHECK(reader->statistics()->messages == cut->messages);
    client::McapBuffer buffer;
    for (const auto& chunk : reader->chunks()) CHECK(reader->load(chunk, buffer));
    CHECK(repair(sample.path, "", true)->was_whole);
}
