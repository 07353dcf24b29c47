// SPDX-License-Identifier: BSD-3-Clause
// Where an export is cut and what it leaves out, judged by the files that it wrote.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include "export/export.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::client;

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t drive_begin_ns = 1'700'000'000'000'000'000;
constexpr std::int64_t drive_ms_ns = 1'000'000;
constexpr std::int64_t drive_ms = 12'000;

/// What a stamp of this millisecond is like.
struct StampTraits {
    std::uint64_t life = 1;
    std::uint32_t epoch = 1;
    std::int64_t step_ms = 0;  ///< of the clock
    std::uint32_t flags = 0;
    std::uint32_t sigma_ns = 20'000;
    bool there = true;
};

using Traits = std::function<StampTraits(std::int64_t at_ms)>;

std::string recorded_drive(const Traits& frames, const Traits& samples) {
    test::RecordingFile file;
    for (std::int64_t at_ms = 0; at_ms < drive_ms; at_ms += 5) {
        const StampTraits sample = samples(at_ms);
        ImuMetadata imu{};
        imu.epoch = sample.epoch;
        imu.flags = sample.flags;
        imu.sigma_ns = sample.sigma_ns;
        const auto number = static_cast<std::uint64_t>(at_ms);
        if (sample.there)
            file.add({"imu0",
                      ring::StreamKind::imu,
                      number,
                      sample.life,
                      {drive_begin_ns + (at_ms + sample.step_ms) * drive_ms_ns},
                      pack(imu),
                      {}});
        const StampTraits traits = frames(at_ms);
        if (at_ms % 50 != 25 || !traits.there) continue;
        FrameMetadata frame{};
        frame.trigger = number / 50 + 1;
        frame.width = frame.stride = 4;
        frame.height = 2;
        frame.pixel_format = 0x01080001;
        frame.exposure = microseconds(500);
        frame.epoch = traits.epoch;
        frame.flags = traits.flags;
        frame.sigma_ns = traits.sigma_ns;
        file.add({"cam0",
                  ring::StreamKind::frames,
                  number / 50,
                  traits.life,
                  {drive_begin_ns + (at_ms + traits.step_ms) * drive_ms_ns + drive_ms_ns},
                  pack(frame),
                  test::sample_pixels(frame, number)});
    }
    return file.finish();
}

/// The first column of an EuRoC table.
std::vector<std::int64_t> stamps_in(const fs::path& path) {
    std::ifstream in(path);
    std::vector<std::int64_t> stamps;
    for (std::string line; std::getline(in, line);)
        if (line[0] != '#') stamps.push_back(std::stoll(line));
    return stamps;
}

struct ExportedDrive {
    test::TemporaryDirectory directory;
    ExportSettings settings;
    Expected<ExportReport> report = failure("export", "not run", "");

    ExportedDrive(const Traits& frames, const Traits& samples, const ExportChoice& choice = {}) {
        settings.recording = directory.write("drive.mcap", recorded_drive(frames, samples));
        settings.directory = directory.path() / "out";
        settings.choice = choice;
        report = export_recording(settings);
    }
    explicit ExportedDrive(const Traits& all) : ExportedDrive(all, all) {}

    std::vector<fs::path> sequences() const {
        if (fs::exists(settings.directory + "/mav0")) return {settings.directory};
        std::vector<fs::path> list;
        for (int i = 1;; ++i) {
            const fs::path path = settings.directory + "/sequence-" + std::to_string(i);
            if (!fs::exists(path)) return list;
            list.push_back(path);
        }
    }
    std::size_t left_out(const std::string& reason) const {
        std::ifstream in(settings.directory + "/left_out.csv");
        std::size_t count = 0;
        for (std::string line; std::getline(in, line);)
            count += line.substr(line.rfind(',') + 1) == reason ? 1 : 0;
        return count;
    }
    std::size_t items() const {
        std::size_t count = 0;
        for (const fs::path& one : sequences())
            count += stamps_in(one / "mav0/cam0/data.csv").size() +
                     stamps_in(one / "mav0/imu0/data.csv").size();
        return count + report->selection.left_out.size();
    }
    /// As odometry needs it: times increase, and near each image are samples before and after.
    void check_continuous() const {
        for (const fs::path& one : sequences()) {
            const auto samples = stamps_in(one / "mav0/imu0/data.csv");
            const auto frames = stamps_in(one / "mav0/cam0/data.csv");
            CHECK_FALSE(frames.empty());
            CHECK(std::is_sorted(frames.begin(), frames.end()));
            for (std::size_t i = 1; i < samples.size(); ++i) {
                CHECK(samples[i] > samples[i - 1]);
                CHECK(samples[i] - samples[i - 1] < 40 * drive_ms_ns);
            }
            CHECK(frames.front() > samples.front());
            CHECK(frames.back() < samples.back());
        }
    }
};

const auto usual_stamps = [](std::int64_t /*at_ms*/) { return StampTraits{}; };

/// Other ones from 6 s until `until_ms`.
Traits between(std::int64_t until_ms, const StampTraits& others,
               const StampTraits& after = StampTraits{}) {
    return [=](std::int64_t at_ms) {
        if (at_ms < 6'000) return StampTraits{};
        return at_ms < until_ms ? others : after;
    };
}

constexpr std::size_t drive_items = drive_ms / 5 + drive_ms / 50;

}  // namespace

TEST_CASE("export_sequences: a drive without a fault is one sequence, of which nothing is lost") {
    const ExportedDrive drive(usual_stamps);
    REQUIRE(drive.report);
    CHECK(drive.sequences() == std::vector<fs::path>{drive.settings.directory});
    CHECK(drive.report->selection.left_out.empty());
    CHECK(drive.items() == drive_items);
    CHECK(test::content_of(drive.settings.directory + "/README.txt").find("sigma up to 20 us") !=
          std::string::npos);
    CHECK(fs::exists(drive.settings.directory + "/verification.html"));
    drive.check_continuous();
}

TEST_CASE("export_sequences: lives and epochs are sequences of their own") {
    StampTraits after;
    std::string cause;
    SECTION("restarted") {
        after.life = 2;
        cause = "the service was restarted";
    }
    SECTION("the clock steps ahead") {
        after.epoch = 2;
        after.step_ms = 1'500;
        cause = "epoch 2 follows epoch 1";
    }
    SECTION("the clock steps back") {
        after.epoch = 2;
        after.step_ms = -300;
        cause = "epoch 2 follows epoch 1";
    }
    SECTION("an epoch of a moment lies in between") {
        after.epoch = 3;
        cause = "epoch 3 follows epoch 2";
    }
    StampTraits moment;
    moment.epoch = 2;
    const bool in_between = after.epoch == 3;
    const ExportedDrive drive(between(in_between ? 6'300 : 6'000, moment, after));
    REQUIRE(drive.report);
    CHECK(drive.sequences().size() == 2);
    CHECK(to_text(*drive.report, false).find(cause) != std::string::npos);
    CHECK(drive.left_out("brief_sequence") + drive.left_out("outside_imu") ==
          (in_between ? 66 : 0));
    CHECK(drive.items() == drive_items);
    drive.check_continuous();
}

TEST_CASE("export_sequences: a hole of the IMU is a cut, and its images are left out") {
    StampTraits gone;
    gone.there = false;
    const ExportedDrive drive(usual_stamps, between(6'500, gone));
    REQUIRE(drive.report);
    CHECK(drive.sequences().size() == 2);
    CHECK(drive.left_out("outside_imu") == 10);
    CHECK(to_text(*drive.report, false).find("a hole of 0.505 s") != std::string::npos);
    drive.check_continuous();
    const ExportedDrive few(usual_stamps, between(6'030, gone));  // tools bridge them
    REQUIRE(few.report);
    CHECK(few.sequences().size() == 1);
    CHECK(few.report->selection.imus[0].longest_gap == milliseconds(35));
}

TEST_CASE("export_sequences: stamps that are worth little are left out, each for its reason") {
    StampTraits bad;
    std::string reason;
    SECTION("suspect") { reason = "suspect", bad.flags = flag_suspect; }
    SECTION("by the trigger") {
        reason = "trigger_edge";
        bad.flags = static_cast<std::uint32_t>(StampKind::trigger_edge);
    }
    SECTION("by arrival") {
        reason = "arrival_only";
        bad.flags = static_cast<std::uint32_t>(StampKind::arrival);
    }
    SECTION("holdover") { reason = "holdover", bad.flags = flag_holdover; }
    SECTION("a large sigma") { reason = "sigma", bad.sigma_ns = 8'000'000; }
    SECTION("an unknown sigma") { reason = "sigma", bad.sigma_ns = sigma_unknown; }
    const ExportedDrive drive(between(8'000, bad), usual_stamps);
    REQUIRE(drive.report);
    CHECK(drive.sequences().size() == 1);
    CHECK(drive.left_out(reason) == 40);
    CHECK(drive.items() == drive_items);
    drive.check_continuous();
    ExportChoice choice;
    choice.include_suspect = true;
    const ExportedDrive whatever(between(8'000, bad), usual_stamps, choice);
    REQUIRE(whatever.report);
    CHECK(whatever.report->selection.left_out.empty());
}

TEST_CASE("export_sequences: without contact to the clock no image is without samples") {
    StampTraits lost;
    lost.flags = flag_holdover;
    const ExportedDrive drive(between(8'000, lost));
    REQUIRE(drive.report);
    CHECK(drive.sequences().size() == 2);
    CHECK(drive.left_out("holdover") == 400 + 40);
    drive.check_continuous();
}

TEST_CASE("export_sequences: --max-sigma is a limit, and where nothing is left it is the reason") {
    ExportChoice choice;
    choice.max_sigma = microseconds(10);
    const ExportedDrive none(usual_stamps, usual_stamps, choice);
    REQUIRE_FALSE(none.report);
    CHECK(none.report.error().message().find("'sigma'") != std::string::npos);
    choice.max_sigma = microseconds(20);
    CHECK(ExportedDrive(usual_stamps, usual_stamps, choice).report);
}

TEST_CASE("export_sequences: --join makes one sequence, and is reported") {
    StampTraits after;
    after.epoch = 2;
    after.step_ms = 1'500;
    ExportChoice choice;
    choice.join = true;
    const Traits all = between(6'000, after, after);
    const ExportedDrive drive(all, all, choice);
    REQUIRE(drive.report);
    CHECK(drive.sequences().size() == 1);
    CHECK(drive.items() == drive_items);
    CHECK(to_text(*drive.report, false).find("--join") != std::string::npos);
}
