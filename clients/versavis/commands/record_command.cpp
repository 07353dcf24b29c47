// SPDX-License-Identifier: BSD-3-Clause
#include "record_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "commands/progress_line.hpp"

namespace versavis::client {

namespace {

/// Something is not in the recording: scripts should know.
constexpr int exit_lost = 1;

struct Unit {
    const char* name;
    double factor;
    bool time;
};

constexpr Unit units[]{
    {"GiB", 1 << 30U, false}, {"MiB", 1 << 20U, false}, {"GB", 1e9, false}, {"MB", 1e6, false},
    {"min", 60, true},        {"h", 3600, true},        {"s", 1, true}};

Duration from_seconds(double seconds) { return {static_cast<std::int64_t>(seconds * 1e9)}; }

double in_seconds(Duration duration) { return static_cast<double>(duration.ns) * 1e-9; }

double rate_of(const StreamReport& stream) {
    const double seconds = in_seconds(stream.last - stream.first);
    return stream.items > 1 && seconds > 0 ? static_cast<double>(stream.items - 1) / seconds : 0;
}

std::string progress_text(const RecordReport& report, std::uint64_t room) {
    const double seconds = std::max(in_seconds(report.duration), 1.0);
    const double rate = static_cast<double>(report.bytes) / seconds;
    return fmt::format(
        "{:.0f} s, {} items, {} lost, {:.1f} MB/s, {:.2f} GB; {}", seconds, report.items(),
        report.lost(), rate * 1e-6, static_cast<double>(report.bytes) * 1e-9,
        rate > 0 ? fmt::format("disk full in {:.0f} min", static_cast<double>(room) / rate / 60)
                 : "");
}

/// Cameras and IMUs of which --before got less than was asked for, and how many seconds less.
std::map<std::string, double> late_begins(const RecordReport& report) {
    constexpr double unsaid_s = 0.5;  // longer than from one frame to the next
    std::map<std::string, double> late;
    if (!report.from) return late;
    for (const auto& [name, stream] : report.streams) {
        const bool steady =
            stream.kind == ring::StreamKind::frames || stream.kind == ring::StreamKind::imu;
        const double seconds = in_seconds(stream.first - *report.from);
        if (steady && stream.items > 0 && seconds > unsaid_s) late[name] = seconds;
    }
    return late;
}

nlohmann::ordered_json report_json(const RecordReport& report) {
    nlohmann::ordered_json streams = nlohmann::ordered_json::object();
    for (const auto& [name, stream] : report.streams)
        streams[name] = {{"items", stream.items},       {"lost", stream.lost},
                         {"restarts", stream.restarts}, {"epochs", stream.epochs},
                         {"first_ns", stream.first.ns}, {"last_ns", stream.last.ns},
                         {"rate_hz", rate_of(stream)}};
    nlohmann::ordered_json document{{"files", report.files},
                                    {"bytes", report.bytes},
                                    {"seconds", in_seconds(report.duration)},
                                    {"items", report.items()},
                                    {"lost", report.lost()},
                                    {"pairing_slips", report.slips},
                                    {"streams", streams},
                                    {"left_out", report.left_out},
                                    {"not_in_camera_info", report.not_in_camera_info},
                                    {"begins_late_s", late_begins(report)}};
    document["stopped_early"] = report.stopped_early
                                    ? nlohmann::ordered_json(report.stopped_early->message())
                                    : nlohmann::ordered_json();
    return document;
}

}  // namespace

Expected<> read_split(const std::string& text, RecordSettings& settings) {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    for (const Unit& unit : units) {
        if (std::string(end) != unit.name || !(value > 0) || !std::isfinite(value)) continue;
        if (unit.time)
            settings.split_length = from_seconds(value * unit.factor);
        else
            settings.split_bytes = static_cast<std::uint64_t>(value * unit.factor);
        return {};
    }
    return failure("--split " + text, "is neither a size nor a time",
                   "write 2GiB, 500MB, 10min, 1h or 30s, say");
}

std::string to_text(const RecordReport& report, bool json) {
    if (json) return report_json(report).dump() + "\n";
    std::string text =
        fmt::format("{:.1f} s, {:.1f} MB in {}\n", in_seconds(report.duration),
                    static_cast<double>(report.bytes) * 1e-6, fmt::join(report.files, ", "));
    for (const auto& [name, stream] : report.streams) {
        text += fmt::format("{:<20} {:>9} items {:>8.1f} Hz {:>6} lost", name, stream.items,
                            rate_of(stream), stream.lost);
        if (stream.restarts > 0) text += fmt::format(", {} restarts", stream.restarts);
        if (stream.epochs > 0) text += fmt::format(", {} new epochs", stream.epochs);
        text += "\n";
    }
    if (report.slips > 0) text += fmt::format("the pairing slipped {} times\n", report.slips);
    for (const auto& [name, late] : late_begins(report))
        text += fmt::format(
            "{} begins {:.1f} s later than --before asked for: its ring held no "
            "more (history_s)\n",
            name, late);
    for (const std::string& why : report.left_out) text += "not recorded: " + why + "\n";
    for (const std::string& why : report.not_in_camera_info)
        text += "attached, but not in camera infos: " + why + "\n";
    if (report.stopped_early)
        text += fmt::format("stopped early: {}\n", report.stopped_early->message());
    return text;
}

RecordCommand::RecordCommand(CLI::App& app, std::function<bool()> stop)
    : command_(app.add_subcommand(
          "record",
          "Record streams into an MCAP file that ROS 2, Foxglove and Lichtblick open. Stop with "
          "Ctrl-C. Exits 0, or 1 if items were lost or the disk was full "
          "(docs/user/recording.md)")) {
    settings_.stop = std::move(stop);
    command_->add_option("stream", settings_.streams, "Streams to record (default: all)");
    command_->add_option("-o,--output", settings_.output,
                         "File to write (default: versavis-DATE-TIME.mcap); NAME/: a new folder "
                         "that 'ros2 bag play' opens, with all files of --split");
    command_->add_option("--seconds", seconds_, "Stop after this many seconds")
        ->check(CLI::PositiveNumber);
    command_->add_option("--split", split_,
                         "Start a new file at this size or duration, e.g. 2GiB or 10min");
    command_
        ->add_option("--before", before_s_,
                     "Include the last N seconds still held in the ring buffers")
        ->check(CLI::PositiveNumber);
    command_
        ->add_option(
            "--compress", compress_,
            "none, or png: lossless, about half the size, costs a third of a CPU core per camera")
        ->check(CLI::IsMember({"none", "png"}))
        ->capture_default_str();
    command_->add_option("--calibration", settings_.calibration,
                         "Kalibr files to attach: camchain.yaml, imu.yaml");
    command_->add_flag("--json", json_, "Print the final report as a JSON object");
}

bool RecordCommand::chosen() const { return command_->parsed(); }

int RecordCommand::run(const std::string& instance) {
    const auto fail = [](const Error& error) {
        fmt::print(stderr, "versavis: {}\n", error.message());
        return EX_UNAVAILABLE;
    };
    settings_.instance = instance;
    settings_.png = compress_ == "png";
    if (seconds_ > 0) settings_.length = from_seconds(seconds_);
    if (before_s_ > 0) settings_.before = from_seconds(before_s_);
    if (!split_.empty())
        if (const auto read = read_split(split_, settings_); !read) {
            fmt::print(stderr, "versavis: {}\n", read.error().message());
            return EX_USAGE;
        }
    auto report = [&] {
        ProgressLine line;
        settings_.progress = [&](const RecordReport& so_far, std::uint64_t room) {
            line.show(progress_text(so_far, room));
        };
        return record(settings_);
    }();
    if (!report) return fail(report.error());
    fmt::print("{}", to_text(*report, json_));
    return report->lost() > 0 || report->stopped_early ? exit_lost : EX_OK;
}

}  // namespace versavis::client
