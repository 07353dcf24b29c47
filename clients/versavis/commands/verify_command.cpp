// SPDX-License-Identifier: BSD-3-Clause
#include "verify_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "base/fail.hpp"
#include "posix/file.hpp"
#include "verify/verification.hpp"

namespace versavis::client {

namespace {

int exit_code(Grade grade) {
    switch (grade) {
        case Grade::untrusted: return 1;
        case Grade::plausible: return 2;
        case Grade::proved: break;
    }
    return EX_OK;
}

}  // namespace

VerifyCommand::VerifyCommand(CLI::App& app, std::function<bool()> stop)
    : command_(app.add_subcommand("verify",
                                  "Verify the timestamps of recordings: derive each again from "
                                  "what was recorded, by code of its own")),
      stop_(std::move(stop)) {
    command_->add_option("recordings", files_, "Recordings (versavis record)")->required();
    command_->add_flag("--json", json_, "Print one JSON object for each recording");
    command_->add_option("--html", html_, "Write a report with time lines to this file");
}

bool VerifyCommand::chosen() const { return command_->parsed(); }

/// 0: all is proved; 1: something is not to be trusted; 2: something is plausible only. A recording
/// that cannot be read does not keep the others from being verified.
int VerifyCommand::run() const {
    if (!html_.empty() && files_.size() > 1)
        return fail({"--html", "a report is about one recording", "name one recording"}, EX_USAGE);
    Grade worst = Grade::proved;
    int unread = EX_OK;
    for (const std::string& file : files_) {
        const auto verification = verify_recording(file, [this] { return !stop_(); });
        if (!verification) {
            unread = fail(verification.error());
            continue;
        }
        fmt::print("{}", json_ ? to_json(*verification).dump() + "\n" : to_text(*verification));
        worst = std::min(worst, verification->grade());
        if (html_.empty()) continue;
        if (const auto written = write_whole_file(html_, to_html(*verification)); !written)
            return fail(written.error(), EX_CANTCREAT);
    }
    return unread == EX_OK ? exit_code(worst) : unread;
}

}  // namespace versavis::client
