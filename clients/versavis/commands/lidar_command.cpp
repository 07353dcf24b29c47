// SPDX-License-Identifier: BSD-3-Clause
#include "commands/lidar_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "base/fail.hpp"
#include "lidar/lidar_check.hpp"

namespace versavis::client {

LidarCommand::LidarCommand(CLI::App& app, std::function<bool()> stop)
    : command_(app.add_subcommand("lidar", "LiDARs that take their time from the board")),
      stop_(std::move(stop)) {
    command_->require_subcommand(1);
    add_check();
    add_phase();
}

void LidarCommand::add_check() {
    CLI::App* check = command_->add_subcommand(
        "check",
        "Show from the packets of LiDARs whether they follow the host's time, and how far off they "
        "can be. Exits 0 if all of them follow, 1 if one does not, 2 if that is not known "
        "(docs/user/lidar.md)");
    CLI::Option* file = check->add_option("file", file_, "Capture of tcpdump or Wireshark");
    check->add_option("-i,--interface", interface_, "Capture at this network interface instead")
        ->excludes(file);
    check->add_option("--seconds", seconds_, "How long to capture")
        ->check(CLI::Range(1, 3600))
        ->capture_default_str()
        ->excludes(file);
    check->add_flag("--json", json_, "Print a JSON array");
}

void LidarCommand::add_phase() {
    phase_ = command_->add_subcommand(
        "phase",
        "Compute phase_us of a camera that is to expose when a rotating LiDAR looks its way "
        "(docs/user/lidar.md)");
    phase_->add_option("azimuth", azimuth_, "Azimuth of the camera's axis, in degrees")->required();
    phase_
        ->add_option("--lock-azimuth", rotation_.lock_azimuth,
                     "Azimuth at each whole second: the LiDAR's phase lock")
        ->capture_default_str();
    phase_->add_option("--rotation-hz", rotation_.rate_hz, "Turns per second")
        ->check(CLI::Range(1, 100))
        ->capture_default_str();
    phase_->add_flag("--counterclockwise", rotation_.counterclockwise,
                     "The azimuth falls while it turns");
    phase_->add_option("--rate", rate_hz_, "The camera's rate_hz (default: one frame per turn)")
        ->check(CLI::Range(0.1, 1000.0));
    phase_->add_flag("--json", json_, "Print one JSON object");
}

int LidarCommand::run() const { return phase_->parsed() ? run_phase() : run_check(); }

int LidarCommand::run_phase() const {
    const auto phase = lidar_phase(rotation_, azimuth_, rate_hz_);
    if (!phase) return fail(phase.error(), EX_USAGE);
    if (json_)
        fmt::print("{{\"phase_us\": {:.3f}, \"frames_per_turn\": {}}}\n", phase->phase_us,
                   phase->frames_per_turn);
    else
        fmt::print("phase_us = {:.3f}    # with align = true in [clock]{}\n", phase->phase_us,
                   phase->frames_per_turn > 1
                       ? fmt::format("; one of {} frames looks its way", phase->frames_per_turn)
                       : "");
    return EX_OK;
}

int LidarCommand::run_check() const {
    if (file_.empty() && interface_.empty())
        return fail(Error{"lidar check", "there is nothing to check",
                          "name a capture, or an interface with --interface"},
                    EX_USAGE);
    const bool live = file_.empty();
    auto capture = live ? Capture::open_interface(interface_) : Capture::open_file(file_);
    if (!capture) return fail(capture.error(), live ? EX_UNAVAILABLE : EX_NOINPUT);
    if (live) fmt::print(stderr, "Capturing for {:g} s ...\n", seconds_);
    LidarCheck check;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds_);
    while (!stop_() && !(live && std::chrono::steady_clock::now() >= end)) {
        const auto datagram = capture->next();
        // What came before a damaged place counts.
        if (!datagram) fail(datagram.error());
        if (!datagram || capture->ended()) break;
        if (*datagram) check.add(**datagram);
    }
    if (const auto dropped = capture->dropped(); dropped > 0)
        fmt::print(stderr, "versavis: {} frames were not read in time\n", dropped);
    const auto reports = check.reports();
    if (json_)
        fmt::print("{}\n", lidar_json(reports).dump());
    else
        fmt::print("{}", reports.empty() ? "no packets of a LiDAR that is known here\n"
                                         : lidar_text(reports));
    constexpr int unproved = 2;
    const auto is = [](LidarVerdict verdict) {
        return [verdict](const LidarReport& report) { return report.verdict == verdict; };
    };
    if (reports.empty() || std::all_of(reports.begin(), reports.end(), is(LidarVerdict::unproved)))
        return unproved;
    return std::all_of(reports.begin(), reports.end(), is(LidarVerdict::follows)) ? EX_OK
                                                                                  : EXIT_FAILURE;
}

}  // namespace versavis::client
