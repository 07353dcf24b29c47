// SPDX-License-Identifier: BSD-3-Clause
#include "process_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "process/recording_process.hpp"

namespace versavis::client {

ProcessCommand::ProcessCommand(CLI::App& app, std::function<bool()> stop)
    : command_(app.add_subcommand("process",
                                  "Recompute the timestamps of a recording: pair the frames again, "
                                  "and smooth the clock over all messages")),
      stop_(std::move(stop)) {
    command_->add_option("recording", file_, "Recording (versavis record)")->required();
    command_->add_option("-o,--output", output_, "File to write")->required();
    command_->add_flag("--json", json_, "Print the report as one JSON object");
}

bool ProcessCommand::chosen() const { return command_->parsed(); }

int ProcessCommand::run() const {
    const bool terminal = isatty(STDERR_FILENO) != 0;
    int shown = 0;
    const auto report = process_recording(file_, output_, [&](double share) {
        const int percent = static_cast<int>(share * 100);
        if (terminal && percent != shown) {
            fmt::print(stderr, "\r{} %", percent);
            std::fflush(stderr);
            shown = percent;
        }
        return !stop_();
    });
    if (terminal) fmt::print(stderr, "\r\x1b[K");
    if (!report) {
        fmt::print(stderr, "versavis: {}\n", report.error().message());
        return EX_UNAVAILABLE;
    }
    fmt::print("{}", json_ ? to_json(*report).dump() + "\n" : to_text(*report));
    return EX_OK;
}

}  // namespace versavis::client
