// SPDX-License-Identifier: BSD-3-Clause
#include "export/export.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::client;
using test::content_of;

namespace fs = std::filesystem;

namespace {

struct ExportSample {
    test::TemporaryDirectory directory;
    ExportSettings settings;

    ExportSample() {
        settings.recording = directory.path() / "a.mcap";
        settings.directory = directory.path() / "out";
        std::ofstream(settings.recording, std::ios::binary)
            << test::sample_recording(1, false, false, 0x01080001);
    }
    std::size_t lines(const std::string& name) const {
        std::ifstream file(fs::path(settings.directory) / name);
        return static_cast<std::size_t>(std::count(std::istreambuf_iterator<char>(file), {}, '\n'));
    }
    bool nothing_left() const {
        return !fs::exists(settings.directory) && !fs::exists(settings.directory + ".part");
    }
};

std::uint64_t left_out(const ExportReport& report, SkipReason reason) {
    std::uint64_t count = 0;
    for (const auto& item : report.selection.left_out) count += item.reason == reason ? 1 : 0;
    return count;
}

}  // namespace

TEST_CASE("export: suspect frames, incomplete sets and repeated samples are left out and listed") {
    ExportSample sample;
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK(left_out(*report, SkipReason::suspect) == 1);
    CHECK(left_out(*report, SkipReason::incomplete) > 1);
    CHECK(left_out(*report, SkipReason::outside_imu) > 1);
    CHECK(left_out(*report, SkipReason::repeated) == 17);
    CHECK(sample.lines("left_out.csv") == 1 + report->selection.left_out.size());
    CHECK(sample.lines("mav0/times.txt") == report->selection.sets);
    CHECK(sample.lines("mav0/cam1/stamps.csv") == 1 + report->selection.sets);
    CHECK(sample.lines("mav0/imu0.csv") == 1 + report->selection.imus[0].samples);
    CHECK(report->selection.imus[0].longest_gap == milliseconds(10));
}

TEST_CASE("export: what was asked for is in") {
    ExportSample sample;
    sample.settings.choice.include_suspect = true;
    sample.settings.choice.keep_repeated = true;
    sample.settings.choice.streams = {"cam0", "imu0"};
    sample.settings.kind = GENERATE(ExportKind::euroc, ExportKind::bag);
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK(left_out(*report, SkipReason::suspect) == 0);
    CHECK(left_out(*report, SkipReason::incomplete) == 0);
    CHECK(report->selection.imus[0].samples == 170);
}

TEST_CASE("export: a directory that is not empty is left alone, an empty one is filled") {
    ExportSample sample;
    fs::create_directories(sample.settings.directory);
    std::ofstream(sample.settings.directory + "/mine") << "mine";
    const auto refused = export_recording(sample.settings);
    REQUIRE_FALSE(refused);
    CHECK_FALSE(refused.error().cure.empty());
    CHECK(fs::file_size(sample.settings.directory + "/mine") == 4);
    fs::remove(sample.settings.directory + "/mine");
    CHECK(export_recording(sample.settings));
    fs::remove_all(sample.settings.directory);
    fs::create_directories(sample.settings.directory + ".part");
    CHECK_FALSE(export_recording(sample.settings));
    CHECK(fs::exists(sample.settings.directory + ".part"));
}

TEST_CASE("export: stopped, or with something wrong, it leaves nothing behind") {
    ExportSample sample;
    sample.settings.kind = GENERATE(ExportKind::euroc, ExportKind::bag, ExportKind::csv);
    int calls = 0;
    SECTION("stopped") {
        sample.settings.watch.stop = [&] { return ++calls > 100; };
        CHECK_FALSE(export_recording(sample.settings));
    }
    SECTION("no such stream") {
        sample.settings.choice.streams = {"cam7"};
        CHECK_FALSE(export_recording(sample.settings));
    }
    CHECK(sample.nothing_left());
}

TEST_CASE("export: a calibration that is another camera's is not used, and reported") {
    ExportSample sample;
    sample.settings.camchain = sample.directory.write(
        "chain.yaml",
        "cam0: {camera_model: pinhole, intrinsics: [1.0, 1.0, 1.0, 1.0], distortion_model: none, "
        "resolution: [640, 480], rostopic: /cam0/image_raw}\n");
    sample.settings.imu_yaml =
        sample.directory.write("imu.yaml", imu_text({0.01, 0.001, 0.002, 3e-05}, "/somewhere", 7));
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK_FALSE(fs::exists(sample.settings.directory + "/camchain.yaml"));
    CHECK(to_text(*report, false).find("640 x 480") != std::string::npos);
    CHECK(sample.lines("imu.yaml") == 6);
}

namespace {

constexpr auto two_cameras =
    "cam0: {cam_overlaps: [1], camera_model: pinhole, intrinsics: [1.0, 1.0, 1.0, 1.0], "
    "distortion_model: none, resolution: [61, 9], rostopic: /cam0/image_raw}\n"
    "cam1: {cam_overlaps: [0], camera_model: pinhole, intrinsics: [2.0, 2.0, 2.0, 2.0], "
    "distortion_model: none, resolution: [61, 9], rostopic: /cam1/image_raw, T_cn_cnm1: "
    "[[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]}\n";

}  // namespace

TEST_CASE("export: the camchain follows the order of the cameras") {
    ExportSample sample;
    sample.settings.camchain = sample.directory.write("chain.yaml", two_cameras);
    sample.settings.choice.streams = {"cam1", "cam0", "imu0"};
    sample.settings.kind = GENERATE(ExportKind::euroc, ExportKind::bag);
    REQUIRE(export_recording(sample.settings));
    const auto text = content_of(sample.settings.directory + "/camchain.yaml");
    const auto chain = parse_camchain(text, "camchain.yaml");
    REQUIRE(chain);
    REQUIRE(chain->size() == 2);
    CHECK(chain->at(0).topic == "/cam1/image_raw");
    CHECK(chain->at(0).intrinsics[0] == 2);
    CHECK_FALSE(chain->at(0).to_previous);
    REQUIRE(chain->at(1).to_previous);
    const Transform back{0, 1, 0, -0.2, -1, 0, 0, 0.1, 0, 0, 1, -0.3, 0, 0, 0, 1};
    for (std::size_t i = 0; i < 16; ++i)
        CHECK(chain->at(1).to_previous->at(i) == Approx(back[i]).margin(1e-12));
    CHECK(chain->at(1).overlaps == std::vector<std::uint32_t>{0});
}

TEST_CASE(
    "export: cameras that the camchain leaves out are reported, and one camera of it is enough") {
    ExportSample sample;
    std::string text = two_cameras;
    SECTION("the first is not known: there is no chain") {
        text.replace(text.find("61"), 2, "62");
        sample.settings.camchain = sample.directory.write("chain.yaml", text);
        const auto report = export_recording(sample.settings);
        REQUIRE(report);
        CHECK_FALSE(fs::exists(sample.settings.directory + "/camchain.yaml"));
        CHECK(to_text(*report, false).find("cam1 is not in camchain.yaml: that of cam0") !=
              std::string::npos);
    }
    SECTION("the second is not known") {
        text.replace(text.rfind("61"), 2, "62");
        sample.settings.camchain = sample.directory.write("chain.yaml", text);
        const auto report = export_recording(sample.settings);
        REQUIRE(report);
        CHECK(to_text(*report, false).find("cam1 is not in camchain.yaml") != std::string::npos);
        const auto written = content_of(sample.settings.directory + "/camchain.yaml");
        CHECK(parse_camchain(written, "camchain.yaml")->size() == 1);
    }
    SECTION("one of two") {
        sample.settings.camchain = sample.directory.write("chain.yaml", text);
        sample.settings.choice.streams = {"cam1"};
        REQUIRE(export_recording(sample.settings));
        const auto written = content_of(sample.settings.directory + "/camchain.yaml");
        CHECK(parse_camchain(written, "camchain.yaml")->at(0).intrinsics[0] == 2);
    }
}

TEST_CASE("export: an exposure that is not known has no row, and that is reported") {
    ExportSample sample;
    test::RecordingFile file;
    for (std::uint64_t i = 0; i < 3; ++i) {
        FrameMetadata frame{};
        frame.trigger = i + 1;
        frame.width = frame.stride = 4;
        frame.height = 2;
        frame.pixel_format = 0x01080001;
        frame.exposure = microseconds(i == 1 ? 0 : 500);
        const auto time = static_cast<std::int64_t>(1'700'000'000'000'000'000 + i);
        file.add({"cam0",
                  ring::StreamKind::frames,
                  i,
                  1,
                  {time},
                  pack(frame),
                  test::sample_pixels(frame, i)});
    }
    sample.settings.recording = sample.directory.write("b.mcap", file.finish());
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK(sample.lines("mav0/cam0/data.csv") == 4);
    CHECK(sample.lines("mav0/cam0/exposure.csv") == 3);
    CHECK(to_text(*report, false).find("exposure of 1 frames is not known") != std::string::npos);
}

TEST_CASE("export: a mosaic of 16 bits is written, with a warning that Kalibr does not take it") {
    ExportSample sample;
    constexpr std::uint32_t bayer_rg12 = 0x01100011;
    std::ofstream(sample.settings.recording, std::ios::binary)
        << test::sample_recording(1, false, false, bayer_rg12);
    sample.settings.kind = GENERATE(ExportKind::euroc, ExportKind::bag);
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK((to_text(*report, false).find("Kalibr refuses") != std::string::npos) ==
          (sample.settings.kind == ExportKind::bag));
}

TEST_CASE("export: a status that is nested without end is left out of its line") {
    ExportSample sample;
    const std::string deep = std::string(300'000, '[') + std::string(300'000, ']');
    const auto* bytes = reinterpret_cast<const std::byte*>(deep.data());
    test::RecordingFile file;
    file.add({"status", ring::StreamKind::status, 0, 1, {5}, {}, {bytes, bytes + deep.size()}});
    sample.settings.recording = sample.directory.write("b.mcap", file.finish());
    sample.settings.kind = ExportKind::csv;
    REQUIRE(export_recording(sample.settings));
    CHECK(content_of(sample.settings.directory + "/status.jsonl").find("\"status\":null") !=
          std::string::npos);
}
