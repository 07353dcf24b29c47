// SPDX-License-Identifier: BSD-3-Clause
#include "recording/recording.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <map>

#include "base/shallow_json.hpp"
#include "pixel_formats.hpp"
#include "recording/recording_info.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::test;
using client::RecordedItem;
using client::Recording;

namespace {

std::vector<std::byte> without_padding(const FrameMetadata& frame, std::size_t row,
                                       std::span<const std::byte> pixels) {
    std::vector<std::byte> rows;
    for (std::size_t y = 0; y < frame.height; ++y)
        rows.insert(rows.end(), pixels.begin() + y * frame.stride,
                    pixels.begin() + y * frame.stride + row);
    return rows;
}

}  // namespace

TEST_CASE("recording: pixels come back bit for bit, from images and PNG, of 8 and 16 bits") {
    const bool as_png = GENERATE(false, true);
    const bool cut_off = GENERATE(false, true);
    const std::uint32_t format = GENERATE(mono8, mono12);
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "a.mcap";
    std::ofstream(path, std::ios::binary) << test::sample_recording(1, as_png, cut_off, format);
    const auto recording = Recording::open(path);
    REQUIRE(recording);
    CHECK(recording->facts().defect.empty() != cut_off);
    std::uint64_t frames = 0;
    REQUIRE(recording->for_each({"cam0", "cam1"}, [&](const RecordedItem& item) {
        const auto frame = unpack<FrameMetadata>(item.metadata);
        const std::size_t row = frame.width * (format == mono8 ? 1U : 2U);
        const auto expected = test::sample_pixels(frame, item.number);
        REQUIRE(item.payload.size() == expected.size());
        CHECK(without_padding(frame, row, item.payload) == without_padding(frame, row, expected));
        CHECK(item.png.empty() != as_png);
        CHECK(item.life == 0x1122334455667788);
        ++frames;
        return true;
    }));
    CHECK(frames == recording->streams()[0].items + recording->streams()[1].items);
    CHECK(recording->attachment("configuration.toml")->content == "instance = \"test\"\n");
    CHECK(recording->facts().metadata.at("output_clock") == "realtime");
}

TEST_CASE("recording: a glance and a place give what reading gives") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "a.mcap";
    std::ofstream(path, std::ios::binary) << test::sample_recording(1, true, false, mono8);
    const auto recording = Recording::open(path);
    REQUIRE(recording);
    struct Seen {
        std::uint64_t number;
        ring::Metadata metadata;
        std::vector<std::byte> payload;
        client::ItemPlace place;
    };
    std::vector<Seen> seen;
    REQUIRE(recording->for_each({}, [&](const RecordedItem& item) {
        seen.push_back(
            {item.number, item.metadata, {item.payload.begin(), item.payload.end()}, item.place});
        return true;
    }));
    std::size_t at = 0;
    REQUIRE(recording->glance({}, [&](const RecordedItem& item) {
        CHECK(item.metadata == seen.at(at).metadata);
        CHECK(item.place.item == seen.at(at).place.item);
        if (item.kind != ring::StreamKind::frames)
            CHECK(std::equal(item.payload.begin(), item.payload.end(), seen.at(at).payload.begin(),
                             seen.at(at).payload.end()));
        ++at;
        return true;
    }));
    CHECK(at == seen.size());
    std::size_t found = 0;
    for (auto one = seen.rbegin(); one != seen.rend(); ++one)
        REQUIRE(recording->at(one->place, [&](const RecordedItem& item) {
            CHECK(item.number == one->number);
            CHECK(std::equal(item.payload.begin(), item.payload.end(), one->payload.begin(),
                             one->payload.end()));
            ++found;
            return true;
        }));
    CHECK(found == seen.size());
}

TEST_CASE("recording: gaps are those of the file, and an image without its item is none") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "a.mcap";
    test::RecordingFile file;
    FrameMetadata frame{};
    frame.width = frame.stride = 4;
    frame.height = 2;
    frame.pixel_format = mono8;
    const test::FileItem item{"cam0",      ring::StreamKind::frames,     5, 1, {77},
                              pack(frame), test::sample_pixels(frame, 5)};
    file.add(item);
    file.add_gap("cam0", "restarted", 0, {78});
    file.end_chunk();
    std::string bytes = file.finish();
    std::ofstream(path, std::ios::binary) << bytes;
    const auto gaps = Recording::open(path)->gaps();
    REQUIRE(gaps);
    REQUIRE(gaps->size() == 1);
    CHECK(gaps->at(0).stream == "cam0");
    CHECK(gaps->at(0).reason == "restarted");
}

TEST_CASE("recording: files after the first are of it, others are reported") {
    const test::TemporaryDirectory directory;
    const auto write = [&](const std::string& name, const std::string& part, std::uint64_t number,
                           const std::string& recording = "1") {
        test::RecordingFile file(part, recording);
        for (int i = 0; i < 3; ++i)
            file.add({"imu0", ring::StreamKind::imu, number++, 1, {100}, {}, {}});
        std::ofstream(directory.path() / name, std::ios::binary) << file.finish();
    };
    write("a.mcap", "0", 0);
    write("a-0001.mcap", "1", 3);
    write("a-0002.mcap", "2", 6);
    write("a-0003.mcap", "0", 100);
    const auto recording = Recording::open(directory.path() / "a.mcap");
    REQUIRE(recording);
    CHECK(recording->facts().files == 3);
    CHECK(recording->facts().defect.find("a-0003.mcap") != std::string::npos);
    CHECK(recording->streams().at(0).items == 9);
    std::uint64_t next = 0;
    std::vector<client::ItemPlace> places;
    REQUIRE(recording->for_each({}, [&](const RecordedItem& item) {
        CHECK(item.number == next++);
        places.push_back(item.place);
        return true;
    }));
    CHECK(next == 9);
    for (std::uint64_t i = 9; i-- > 0;)
        REQUIRE(recording->at(places.at(i), [&](const RecordedItem& item) {
            CHECK(item.number == i);
            return true;
        }));
    CHECK(Recording::open_file(directory.path() / "a.mcap")->streams().at(0).items == 3);
    CHECK(Recording::open(directory.path() / "a-0001.mcap")->streams().at(0).items == 3);
    std::uint64_t taken = 0;
    REQUIRE(recording->glance({}, [&](const RecordedItem&) { return ++taken < 4; }));
    CHECK(taken == 4);
    write("a-0001.mcap", "1", 3, "2");  // left from an earlier one of the same name
    const auto other = Recording::open(directory.path() / "a.mcap");
    REQUIRE(other);
    CHECK(other->facts().files == 2);
    CHECK(other->facts().defect.find("a-0001.mcap") != std::string::npos);
    std::filesystem::remove(directory.path() / "a-0001.mcap");
    const auto without = Recording::open(directory.path() / "a.mcap");
    REQUIRE(without);
    CHECK(without->streams().at(0).items == 6);
    CHECK(without->facts().missing == std::vector<std::string>{"a-0001.mcap"});
    const auto info = client::recording_info("a.mcap", *without);
    REQUIRE(info);
    CHECK_FALSE((*info)["whole"].get<bool>());
    CHECK_THAT(client::info_text(*info), Catch::Contains("missing: a-0001.mcap"));
}

TEST_CASE("recording: its begin and length are those of stamps, where there are any") {
    const test::TemporaryDirectory directory;
    const auto item = [](const char* stream, ring::StreamKind kind, Duration time) {
        return test::FileItem{stream, kind, 0, 1, OutputTime{} + time, {}, {}};
    };
    test::RecordingFile file;
    file.add(item("clock", ring::StreamKind::clock, seconds(100)));
    const auto period = [&](const test::RecordingFile& written) {
        auto copy = written;
        const auto path = directory.write("a.mcap", copy.finish());
        const auto recording = Recording::open(path);
        REQUIRE(recording);
        const auto info = client::recording_info(path, *recording);
        REQUIRE(info);
        return std::pair((*info)["begin_ns"].get<std::int64_t>(),
                         (*info)["duration_ns"].get<std::int64_t>());
    };
    file.add(item("clock", ring::StreamKind::clock, seconds(103)));
    CHECK(period(file) == std::pair(seconds(100).ns, seconds(3).ns));
    file.add(item("events", ring::StreamKind::events, seconds(401)));
    file.add(item("imu0", ring::StreamKind::imu, seconds(400)));
    file.add(item("imu0", ring::StreamKind::imu, seconds(402)));
    file.add(item("cam0-evidence", ring::StreamKind::evidence, seconds(50)));
    file.add(item("status", ring::StreamKind::status, seconds(500)));
    CHECK(period(file) == std::pair(seconds(400).ns, seconds(2).ns));
}

TEST_CASE("recording: a stamp that is no time is reported, with its place") {
    const test::TemporaryDirectory directory;
    const std::int64_t ns = GENERATE(INT64_MIN, INT64_MAX, std::int64_t{1} << 61);
    test::RecordingFile file;
    file.add({"imu0", ring::StreamKind::imu, 0, 1, OutputTime{ns}, {}, {}});
    const auto recording = Recording::open(directory.write("a.mcap", file.finish()));
    REQUIRE(recording);
    REQUIRE(recording->for_each({}, [](const RecordedItem&) {
        FAIL("it is given");
        return true;
    }));
    REQUIRE(recording->damages().size() == 1);
    CHECK_THAT(recording->damages()[0], Catch::Contains("the stamp of an item is no time"));
}

TEST_CASE("recording: JSON that is nested without end is as good as damaged") {
    const auto nested = [](int levels) {
        return std::string(levels, '[') + std::string(levels, ']');
    };
    CHECK(client::parse_shallow_json(R"({"a":[{"b":1}]})")["a"][0]["b"] == 1);
    CHECK(client::parse_shallow_json(nested(client::deepest_json)).is_array());
    CHECK(client::parse_shallow_json(nested(client::deepest_json + 2)).is_discarded());
    CHECK(client::parse_shallow_json(nested(1'000'000)).is_discarded());
    CHECK(client::parse_shallow_json(std::string(1'000'000, '[')).is_discarded());
    CHECK(client::parse_shallow_json("{").is_discarded());
}
