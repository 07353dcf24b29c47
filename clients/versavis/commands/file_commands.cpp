// SPDX-License-Identifier: BSD-3-Clause
#include "file_commands.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>

#include "base/fail.hpp"
#include "commands/progress_line.hpp"
#include "export/time_shift.hpp"
#include "recording/recording_info.hpp"
#include "recording/repair.hpp"

namespace versavis::client {

namespace {

constexpr auto default_replay = "replay";

/// None: no recording was named.
Expected<std::optional<Duration>> filter_delay(const std::string& path, const std::string& imu) {
    if (path.empty()) return std::optional<Duration>();
    const auto recording = Recording::open(path);
    if (!recording) return Unexpected(recording.error());
    const auto delay = recorded_filter_delay(*recording, imu, path);
    if (!delay) return Unexpected(delay.error());
    return std::optional(*delay);
}

}  // namespace

FileCommands::FileCommands(CLI::App& app, std::function<bool()> stop) : stop_(std::move(stop)) {
    add_info(app);
    add_repair(app);
    add_export(app);
    add_play(app);
    add_calibration(app);
}

void FileCommands::add_info(CLI::App& app) {
    info_ = app.add_subcommand(
        "info",
        "Show a recording's streams, rates, gaps and attachments, and whether it is complete");
    info_->add_option("file", file_, "Recording")->required();
    info_->add_flag("--check", check_, "Read the whole file and check all checksums");
    info_->add_flag("--json", json_, "Print a JSON object");
}

void FileCommands::add_repair(CLI::App& app) {
    repair_ = app.add_subcommand("repair",
                                 "Complete a truncated or damaged recording with all that can "
                                 "be read. What is cut off is kept in FILE.cut; a file with "
                                 "other damage as FILE.damaged");
    repair_->add_option("file", file_, "Recording")->required();
    repair_->add_option("-o,--output", output_, "Write a new file, and leave this one unchanged");
    repair_->add_flag("--cut", cut_, "End the recording before the first damaged chunk");
    repair_->add_flag("--json", json_, "Print a JSON object");
}

void FileCommands::add_export(CLI::App& app) {
    static const std::map<std::string, ExportKind> kinds{
        {"euroc", ExportKind::euroc}, {"bag", ExportKind::bag}, {"csv", ExportKind::csv}};
    static const std::map<std::string, BagCompression> compressions{{"none", BagCompression::none},
                                                                    {"lz4", BagCompression::lz4}};
    export_ = app.add_subcommand(
        "export",
        "Export a recording for other tools: EuRoC folder, ROS 1 bag or CSV (docs/user/export.md)");
    export_->add_option("file", export_settings_.recording, "Recording")->required();
    export_->add_option("directory", export_settings_.directory, "New or empty directory")
        ->required();
    export_->add_option("--to", export_settings_.kind, "euroc, bag or csv")
        ->transform(CLI::CheckedTransformer(kinds).description("{euroc,bag,csv}"))
        ->type_name("FORMAT")
        ->required();
    export_
        ->add_option("--streams", export_settings_.choice.streams,
                     "Cameras and IMUs to export; sets are named by the first camera's stamps "
                     "(default: all, by name)")
        ->delimiter(',');
    export_->add_flag("--include-suspect", export_settings_.choice.include_suspect,
                      "Include frames and samples whatever their stamps are worth");
    export_->add_flag("--keep-repeated", export_settings_.choice.keep_repeated,
                      "Include IMU samples that repeat the previous one");
    export_->add_flag("--join", export_settings_.choice.join,
                      "Write one sequence, across restarts, epochs and holes of the IMU");
    export_
        ->add_option_function<double>(
            "--max-sigma",
            [this](double us) {
                export_settings_.choice.max_sigma = Duration{static_cast<std::int64_t>(us * 1e3)};
            },
            "Leave out stamps of a larger sigma, us (default: 5000; any with --include-suspect)")
        ->check(CLI::Range(0.0, 4e6))  // an unknown sigma is above
        ->type_name("US");
    export_
        ->add_option("--compression", export_settings_.compression, "Bag compression: none or lz4")
        ->transform(CLI::CheckedTransformer(compressions).description("{none,lz4}"))
        ->type_name("NAME");
    export_->add_option(
        "--camchain", export_settings_.camchain,
        "Kalibr's camera calibration (default: the attachment calibration/camchain.yaml)");
    export_->add_option(
        "--imu", export_settings_.imu_yaml,
        "Kalibr's imu.yaml with the IMU's noise (default: the attachment calibration/imu.yaml)");
    export_->add_flag("--json", json_, "Print the report as a JSON object");
}

void FileCommands::add_play(CLI::App& app) {
    play_ = app.add_subcommand(
        "play",
        "Publish a recording as streams again, paced by its stamps, in the instance 'replay' or "
        "that of --instance. Programs read it like the service");
    play_->add_option("file", file_, "Recording")->required();
    play_->add_option("streams", play_settings_.streams, "Streams (default: all)");
    play_->add_option("--rate", play_settings_.rate, "Playback speed factor (2 = twice real time)")
        ->check(CLI::Range(0.001, 1000.0))
        ->capture_default_str();
    play_->add_flag("--loop", play_settings_.loop, "Loop until interrupted");
}

void FileCommands::add_calibration(CLI::App& app) {
    calibration_ = app.add_subcommand("calibration",
                                      "Convert the time offset between cameras and IMU in Kalibr's "
                                      "camchain-imucam.yaml to a configuration value");
    calibration_->add_option("file", file_, "Kalibr's camchain-imucam.yaml")->required();
    auto* recording =
        calibration_->add_option("--recording", recording_, "Recording used for the calibration");
    calibration_->add_option("--imu", imu_, "The calibrated IMU, if the recording has several")
        ->needs(recording);
    calibration_->add_flag("--json", json_, "Print a JSON object");
}

bool FileCommands::chosen() const {
    for (const CLI::App* one : {info_, repair_, export_, play_, calibration_})
        if (one->parsed()) return true;
    return false;
}

int FileCommands::run(const std::string& instance) {
    if (info_->parsed()) return show_info();
    if (repair_->parsed()) return repair_file();
    if (export_->parsed()) return export_file();
    return play_->parsed() ? play_file(instance) : show_calibration();
}

int FileCommands::show_info() const {
    const auto recording = Recording::open(file_);
    if (!recording) return fail(recording.error());
    if (check_) recording->check();
    const auto info = recording_info(file_, *recording);
    if (!info) return fail(info.error());
    using Json = nlohmann::json;
    fmt::print("{}", json_ ? info->dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"
                           : info_text(*info));
    return EX_OK;
}

int FileCommands::repair_file() const {
    const auto repaired = repair(file_, output_, cut_);
    if (!repaired) return fail(repaired.error());
    fmt::print("{}", to_text(*repaired, json_));
    return EX_OK;
}

int FileCommands::export_file() {
    ProgressLine line;
    export_settings_.watch.stop = stop_;
    export_settings_.watch.progress = [&](const char* what, std::uint64_t done, std::uint64_t all) {
        line.show(fmt::format("{} {} of {}", what, done, all));
    };
    const auto report = export_recording(export_settings_);
    line.end();
    if (!report) return fail(report.error());
    fmt::print("{}", to_text(*report, json_));
    return EX_OK;
}

int FileCommands::play_file(const std::string& instance) {
    const auto recording = Recording::open(file_);
    if (!recording) return fail(recording.error());
    ProgressLine line;
    play_settings_.instance = instance.empty() ? default_replay : instance;
    play_settings_.stop = stop_;
    play_settings_.progress = [&](double seconds, double all) {
        line.show(fmt::format("{:.1f} of {:.1f} s", seconds, all));
    };
    const auto report = play(*recording, play_settings_);
    line.end();
    if (!report) return fail(report.error());
    for (const std::string& file : recording->facts().missing)
        fmt::print(stderr, "versavis: {} is missing and was not played\n", file);
    for (const std::string& damage : recording->damages())
        fmt::print(stderr, "versavis: not played: {}\n", damage);
    fmt::print("{} items played in instance {}, the latest {:.1f} ms late\n", report->items,
               play_settings_.instance, static_cast<double>(report->latest.ns) / 1e6);
    if (report->without_pixels > 0)
        fmt::print(stderr, "versavis: {} frames had no pixels and were not played\n",
                   report->without_pixels);
    return EX_OK;
}

int FileCommands::show_calibration() const {
    std::ifstream in(file_, std::ios::binary);
    if (!in) return fail({file_, "cannot be read", "check its name and permissions"});
    const auto cameras = parse_camchain(std::string(std::istreambuf_iterator<char>(in), {}), file_);
    if (!cameras) return fail(cameras.error());
    const auto delay = filter_delay(recording_, imu_);
    if (!delay) return fail(delay.error());
    const auto shift = time_shift(*cameras, *delay, file_);
    if (!shift) return fail(shift.error());
    fmt::print("{}", to_text(*shift, json_));
    return EX_OK;
}

}  // namespace versavis::client
