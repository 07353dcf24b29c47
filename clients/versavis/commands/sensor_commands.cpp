// SPDX-License-Identifier: BSD-3-Clause
#include "sensor_commands.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "evaluate/allan_report.hpp"
#include "evaluate/clock_evaluation.hpp"
#include "evaluate/recorded_imu.hpp"
#include "export/export.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

void add_file(CLI::App& command, std::string& file, bool& json) {
    command.add_option("recording", file, "Recording (versavis record)")->required();
    command.add_flag("--json", json, "Print the report as one JSON object");
}

void add_part(CLI::App& command, double& from_s, double& to_s) {
    command.add_option("--from", from_s, "Start this many seconds after the IMU's first sample")
        ->check(CLI::NonNegativeNumber);
    command.add_option("--to", to_s, "End this many seconds after the IMU's first sample")
        ->check(CLI::PositiveNumber);
}

}  // namespace

SensorCommands::SensorCommands(CLI::App& evaluate, std::function<bool()> stop)
    : stop_(std::move(stop)) {
    add_imu(evaluate);
    add_allan(evaluate);
    add_clock(evaluate);
}

void SensorCommands::add_imu(CLI::App& evaluate) {
    imu_ = evaluate.add_subcommand(
        "imu",
        "Estimate time offset and rotation between a camera and an IMU from their common motion, "
        "without a target. Exits 65 if the motion does not determine them");
    add_file(*imu_, file_, json_);
    imu_->add_option("--camera", settings_.camera, "Camera (default: the only one)");
    imu_->add_option("--imu", settings_.imu, "IMU (default: the only one)");
    imu_->add_option("--calibration", settings_.calibration,
                     "Kalibr's camchain.yaml (default: as recorded)");
    imu_->add_option("--focal", settings_.focal,
                     "Focal length in pixels, for a lens without distortion")
        ->check(CLI::PositiveNumber);
    imu_->add_option("--range", range_ms_, "Search offsets within +- this, in ms")
        ->check(CLI::Range(1.0, 5000.0))
        ->capture_default_str();
    add_part(*imu_, settings_.from_s, settings_.to_s);
}

void SensorCommands::add_allan(CLI::App& evaluate) {
    allan_ = evaluate.add_subcommand("allan",
                                     "Estimate noise densities and random walks of an IMU at rest. "
                                     "Exits 1 if the recording is too short for a random walk");
    add_file(*allan_, file_, json_);
    allan_->add_option("--imu", settings_.imu, "IMU (default: the only one)");
    allan_->add_option("--yaml", yaml_, "Write Kalibr's imu.yaml to this file");
    allan_->add_option("--topic", topic_, "rostopic in that file (default: as in an export)");
    add_part(*allan_, settings_.from_s, settings_.to_s);
}

void SensorCommands::add_clock(CLI::App& evaluate) {
    clock_ = evaluate.add_subcommand("clock",
                                     "Assess the board-to-host clock conversion: innovation, "
                                     "residual, and the true error where PPS was recorded");
    add_file(*clock_, file_, json_);
}

bool SensorCommands::chosen() const {
    return imu_->parsed() || allan_->parsed() || clock_->parsed();
}

int SensorCommands::fail(const Error& error) const {
    fmt::print(
        stderr, "versavis: {}\n",
        error.where.empty() ? file_ + ": " + error.message() : file_ + ", " + error.message());
    return EX_DATAERR;
}

int SensorCommands::run() {
    const auto recording = Recording::open(file_);
    if (!recording) {
        fmt::print(stderr, "versavis: {}\n", recording.error().message());
        return EX_NOINPUT;
    }
    if (imu_->parsed()) return run_imu(*recording);
    return allan_->parsed() ? run_allan(*recording) : run_clock(*recording);
}

int SensorCommands::run_imu(const Recording& recording) {
    settings_.range = {static_cast<std::int64_t>(range_ms_ * 1e6)};
    const bool terminal = isatty(STDERR_FILENO) != 0;
    settings_.watch = [this, terminal](std::size_t frames) {
        if (terminal && frames > 0 && frames % 20 == 0) {
            fmt::print(stderr, "\r{} frames", frames);
            std::fflush(stderr);
        }
        return !stop_();
    };
    const auto evaluation = evaluate_imu(recording, settings_);
    if (terminal) fmt::print(stderr, "\r\x1b[K");
    if (!evaluation) return fail(evaluation.error());
    fmt::print("{}", json_ ? to_json(*evaluation).dump() + "\n" : to_text(*evaluation));
    return EX_OK;
}

int SensorCommands::run_allan(const Recording& recording) const {
    const auto name = find_stream(recording, ring::StreamKind::imu, settings_.imu);
    if (!name) return fail(name.error());
    const auto imu = read_imu(recording, *name, settings_.from_s, settings_.to_s, Repeated::kept,
                              [this] { return !stop_(); });
    if (!imu) return fail(imu.error());
    const auto result = evaluate_allan(imu->samples);
    if (!result) return fail(result.error());
    fmt::print("{}", json_ ? to_json(*result).dump() + "\n" : to_text(*result));
    const double needed = walk_needs_s(*result);
    if (yaml_.empty()) return needed > 0 || is_smooth(*result) ? EXIT_FAILURE : EX_OK;
    const auto text = kalibr_imu_yaml(*result, topic_.empty() ? imu_topic(*name) : topic_);
    if (!text) {
        fail(text.error());
        return EXIT_FAILURE;
    }
    if (const auto written = write_whole_file(yaml_, *text); !written) {
        fmt::print(stderr, "versavis: {}\n", written.error().message());
        return EX_CANTCREAT;
    }
    return EX_OK;
}

int SensorCommands::run_clock(const Recording& recording) const {
    const auto clocks = read_clocks(recording, [this] { return !stop_(); });
    if (!clocks) return fail(clocks.error());
    const auto evaluation = evaluate_clock(*clocks);
    if (!evaluation) return fail(evaluation.error());
    fmt::print("{}", json_ ? to_json(*evaluation).dump() + "\n" : to_text(*evaluation));
    return EX_OK;
}

}  // namespace versavis::client
