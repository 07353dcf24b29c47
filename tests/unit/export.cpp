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

namespace fs = std::filesystem;

namespace {

struct Sample {
    test::TemporaryDirectory directory;
    ExportSettings settings;

    Sample() {
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

std::uint64_t left_out(const ExportReport& report, LeftOut reason) {
    std::uint64_t count = 0;
    for (const auto& item : report.selection.left_out) count += item.reason == reason ? 1 : 0;
    return count;
}

}  // namespace

TEST_CASE("export: suspect frames, incomplete sets and repeated samples are left out and listed") {
    Sample sample;
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK(left_out(*report, LeftOut::suspect) == 1);
    CHECK(left_out(*report, LeftOut::incomplete) > 1);
    CHECK(left_out(*report, LeftOut::outside_imu) > 1);
    CHECK(left_out(*report, LeftOut::repeated) == 17);
    CHECK(sample.lines("left_out.csv") == 1 + report->selection.left_out.size());
    CHECK(sample.lines("mav0/times.txt") == report->selection.sets);
    CHECK(sample.lines("mav0/cam1/stamps.csv") == 1 + report->selection.sets);
    CHECK(sample.lines("mav0/imu0.csv") == 1 + report->selection.samples.size());
    CHECK(report->selection.imus[0].longest_gap == milliseconds(10));
}

TEST_CASE("export: what was asked for is in") {
    Sample sample;
    sample.settings.choice.include_suspect = true;
    sample.settings.choice.keep_repeated = true;
    sample.settings.choice.streams = {"cam0", "imu0"};
    sample.settings.kind = GENERATE(ExportKind::euroc, ExportKind::bag);
    const auto report = export_recording(sample.settings);
    REQUIRE(report);
    CHECK(left_out(*report, LeftOut::suspect) == 0);
    CHECK(left_out(*report, LeftOut::incomplete) == 0);
    CHECK(report->selection.samples.size() == 170);
}

TEST_CASE("export: a directory that is not empty is left alone, an empty one is filled") {
    Sample sample;
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
    Sample sample;
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

TEST_CASE("export: a calibration that is another camera's is not used, and told") {
    Sample sample;
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
