// SPDX-License-Identifier: BSD-3-Clause
#include "commands/gnss_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <iterator>

#include "base/fail.hpp"
#include "posix/file.hpp"

namespace versavis::client {

GnssCommand::GnssCommand(CLI::App& app)
    : command_(app.add_subcommand("gnss", "GNSS receivers that get a pulse of each exposure")) {
    command_->require_subcommand(1);
    CLI::App* match = command_->add_subcommand(
        "match",
        "Give each frame of a recording the time mark that a u-blox receiver made of its pulse "
        "(UBX-TIM-TM2). Exits 65 where more than one mark could be meant (docs/user/gnss.md)");
    match->add_option("recording", recording_, "Recording (versavis record)")->required();
    match->add_option("marks", marks_, "Output of the receiver: a .ubx file")->required();
    match->add_option("--camera", settings_.camera, "Camera (default: the only one)");
    match->add_option("--channel", settings_.channel, "Number of the EXTINT pin")
        ->check(CLI::Range(0, 255))
        ->capture_default_str();
    match->add_flag("--falling", falling_, "The falling edge marks the exposure");
    match
        ->add_option("--leap-seconds", settings_.leap_seconds,
                     "Of marks in GNSS time: how many seconds that is ahead of UTC (GPS: 18)")
        ->check(CLI::Range(0, 60));
    match->add_option("-o,--csv", csv_, "Write a row for each frame with a mark to this file");
    match->add_flag("--json", json_, "Print the report as one JSON object");
}

int GnssCommand::run() const {
    const auto recording = Recording::open(recording_);
    if (!recording) return fail(recording.error(), EX_NOINPUT);
    std::ifstream file(marks_, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    if (!file)
        return fail({marks_, "cannot be read", "check its name and permissions"}, EX_NOINPUT);
    GnssMatchSettings settings = settings_;
    settings.edge = falling_ ? MarkEdge::falling : MarkEdge::rising;
    const UbxMarks marks = read_time_marks(std::as_bytes(std::span(bytes)), settings.edge);
    if (marks.marks.empty())
        return fail(
            Error{marks_, fmt::format("has no time marks among {} UBX messages", marks.messages),
                  "enable UBX-TIM-TM2 in the receiver and log its output as it is"},
            EX_DATAERR);
    const auto report = match_gnss(*recording, marks, settings);
    if (!report) return fail(report.error(), EX_DATAERR);
    if (!csv_.empty())
        if (const auto written = write_new_file(csv_, to_csv(*report)); !written)
            return fail(written.error(), EX_CANTCREAT);
    if (json_)
        fmt::print("{}\n", to_json(*report).dump());
    else
        fmt::print("{}", to_text(*report));
    for (const GnssSequence& sequence : report->sequences)
        if (sequence.match.proof == MatchProof::none) return EX_DATAERR;
    return report->frames.empty() ? EX_DATAERR : EX_OK;
}

}  // namespace versavis::client
