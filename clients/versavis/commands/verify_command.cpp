// SPDX-License-Identifier: BSD-3-Clause
#include "verify_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "base/fail.hpp"
#include "live_verification.hpp"
#include "posix/file.hpp"
#include "posix/journal.hpp"
#include "verify/signature.hpp"
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
    command_->add_option("recordings", files_,
                         "Recordings (versavis record); with --live: cameras (default: all)");
    command_->add_flag("--json", json_, "Print one JSON object for each recording");
    auto* html =
        command_->add_option("--html", html_, "Write a report with time lines to this file");
    auto* pictures = command_->add_flag(
        "--pictures", compare_pictures_,
        "Compare the rotation of the pictures with the gyro, too: reads all pixels");
    auto* live = command_->add_flag(
        "--live", live_,
        "Compare the pictures of the running cameras with the gyro until stopped, and report when "
        "they no longer belong to their stamps");
    command_->add_option("--seconds", seconds_, "Stop after this time (default: when interrupted)")
        ->check(CLI::PositiveNumber)
        ->needs(live);
    command_->add_option("--imu", pictures_.imu, "The IMU to compare with, if there are several");
    command_->add_option("--calibration", pictures_.calibration,
                         "Kalibr's camchain.yaml (default: the recording's attachment)");
    command_
        ->add_option("--focal", pictures_.focal, "Focal length in pixels, instead of a calibration")
        ->check(CLI::PositiveNumber);
    auto* sign = command_->add_option(
        "--sign", key_,
        "Write FILE.verdict.json and its signature by this Ed25519 key, FILE.verdict.sig");
    command_
        ->add_option("--signed-by", public_key_,
                     "Verify nothing: print the verdict that was signed by the owner of this "
                     "public key, if it and the recording are unchanged")
        ->excludes(html)
        ->excludes(pictures)
        ->excludes(sign);
    for (auto* option : {html, pictures, sign}) live->excludes(option);
    live->excludes("--signed-by");
}

bool VerifyCommand::chosen() const { return command_->parsed(); }

/// 0: all is proved; 1: something is not to be trusted; 2: something is plausible only. A recording
/// that cannot be read does not keep the others from being verified.
int VerifyCommand::run(const std::string& instance) const {
    if (live_) return verify_instance(instance);
    if (files_.empty())
        return fail({"verify", "no recording is named", "name one, or give --live"}, EX_USAGE);
    const bool compares =
        !pictures_.imu.empty() || !pictures_.calibration.empty() || pictures_.focal > 0;
    if (compares && !compare_pictures_)
        return fail(
            {"--imu, --calibration, --focal", "are for pictures", "give --pictures or --live, too"},
            EX_USAGE);
    return public_key_.empty() ? verify_files() : check_signatures();
}

int VerifyCommand::verify_instance(const std::string& instance) const {
    // The journal takes this for the priority of the line (sd-daemon(3)).
    const bool journal = is_journal(STDOUT_FILENO);
    const auto say = [journal](const std::string& line, bool alarm) {
        fmt::print("{}{}\n", journal && alarm ? "<4>" : "", line);
        std::fflush(stdout);
    };
    const auto worst = verify_live({instance, files_, pictures_.imu, pictures_.calibration,
                                    pictures_.focal, seconds_, json_, stop_, say});
    return worst ? exit_code(*worst) : fail(worst.error());
}

int VerifyCommand::verify_files() const {
    if (!html_.empty() && files_.size() > 1)
        return fail({"--html", "a report is about one recording", "name one recording"}, EX_USAGE);
    Grade worst = Grade::proved;
    int unread = EX_OK;
    const auto go_on = [this] { return !stop_(); };
    for (const std::string& file : files_) {
        const auto verification = verify_recording(
            file, go_on,
            compare_pictures_ ? pictures_of(file) : std::map<std::string, PictureEvidence>());
        if (!verification) {
            unread = fail(verification.error());
            continue;
        }
        fmt::print("{}", json_ ? to_json(*verification).dump() + "\n" : to_text(*verification));
        worst = std::min(worst, verification->grade());
        if (!key_.empty())
            if (const auto written = sign_verdict(file, *verification, key_, go_on); !written)
                return fail(written.error(), EX_CANTCREAT);
        if (html_.empty()) continue;
        if (const auto written = write_whole_file(html_, to_html(*verification)); !written)
            return fail(written.error(), EX_CANTCREAT);
    }
    return unread == EX_OK ? exit_code(worst) : unread;
}

std::map<std::string, PictureEvidence> VerifyCommand::pictures_of(const std::string& file) const {
    std::map<std::string, PictureEvidence> found;
    const auto recording = Recording::open(file);
    if (!recording) return found;  // verify_recording() says why
    for (const RecordedStream& stream : recording->streams()) {
        if (stream.kind != ring::StreamKind::frames) continue;
        ImuEvaluationSettings settings = pictures_;
        settings.camera = stream.name;
        settings.watch = [this](std::size_t /*frames*/) { return !stop_(); };
        found[stream.name] = compare_pictures(*recording, settings);
    }
    return found;
}

int VerifyCommand::check_signatures() const {
    Grade worst = Grade::proved;
    for (const std::string& file : files_) {
        const auto verdict = signed_verdict(file, public_key_, [this] { return !stop_(); });
        if (!verdict) return fail(verdict.error());
        if (verdict->forged) return fail(*verdict->forged, exit_code(Grade::untrusted));
        const nlohmann::json& found = verdict->verification;
        const std::string grade = found.value("verdict", "");
        fmt::print("{}", json_ ? found.dump() + "\n"
                               : fmt::format("{}: unchanged since it was signed: {}\n{}\n", file,
                                             grade, found.value("sentence", "")));
        for (const Grade one : {Grade::untrusted, Grade::plausible})
            if (grade == to_string(one)) worst = std::min(worst, one);
    }
    return exit_code(worst);
}

}  // namespace versavis::client
