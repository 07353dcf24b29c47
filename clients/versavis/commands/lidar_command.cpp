// SPDX-License-Identifier: BSD-3-Clause
#include "commands/lidar_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "base/fail.hpp"
#include "control/control_client.hpp"

namespace versavis::client {

namespace {

/// What the service keeps.
constexpr std::size_t most_lidars = 32;

/// Those with the most packets: not what a stranger in the network makes up. One that has just
/// begun belongs to the next report.
std::vector<LidarReport> worth_reporting(std::vector<LidarReport> reports) {
    std::erase_if(reports,
                  [](const LidarReport& report) { return report.duration < shortest_record; });
    std::sort(reports.begin(), reports.end(),
              [](const LidarReport& a, const LidarReport& b) { return a.packets > b.packets; });
    if (reports.size() > most_lidars) reports.resize(most_lidars);
    return reports;
}

/// Empty, or why the service does not know them.
std::string reported(const std::vector<LidarReport>& reports, const std::string& interface,
                     const std::string& instance) {
    if (reports.empty()) return "";
    auto service = ControlClient::connect(instance);
    if (!service) return service.error().message();
    nlohmann::json lidars = lidar_json(reports);
    for (std::size_t i = 0; i < reports.size(); ++i) {
        lidars[i]["source"] = reports[i].source + "%" + interface;
        const LidarVerdict verdict = reports[i].verdict;
        // Of a clock that is another one, the bounds say nothing.
        if (verdict != LidarVerdict::follows && verdict != LidarVerdict::drifts)
            lidars[i]["behind_ns"] = lidars[i]["ahead_ns"] = nullptr;
    }
    const auto done = service->call("ReportLidars", {{"lidars", lidars}});
    return done ? "" : done.error().message();
}

}  // namespace

LidarCommand::LidarCommand(CLI::App& app, std::function<bool()> stop)
    : command_(app.add_subcommand("lidar", "LiDARs that take their time from the board")),
      stop_(std::move(stop)) {
    command_->require_subcommand(1);
    add_check();
    add_watch();
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

void LidarCommand::add_watch() {
    watch_ = command_->add_subcommand(
        "watch",
        "Watch the packets of LiDARs at a network interface, and report to the service whether "
        "they follow: 'versavis status' shows it. Prints what changes (docs/user/lidar.md)");
    watch_->add_option("-i,--interface", interface_, "The network interface")->required();
    constexpr int shortest_window_s = 6;  // a drift shows after 5 s
    constexpr int longest_window_s = 20;  // the service keeps a report for 30 s
    watch_->add_option("--seconds", seconds_, "From one report to the next")
        ->check(CLI::Range(shortest_window_s, longest_window_s))
        ->capture_default_str();
    watch_->add_flag("--json", json_, "Print one JSON array per report");
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

int LidarCommand::run(const std::string& instance) const {
    if (phase_->parsed()) return run_phase();
    return watch_->parsed() ? run_watch(instance) : run_check();
}

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

/// All that comes, or for as long as is asked for. None: nothing more can be read.
std::optional<LidarCheck> LidarCommand::look(Capture& capture, bool live) const {
    LidarCheck check;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds_);
    while (!stop_() && !(live && std::chrono::steady_clock::now() >= end)) {
        const auto datagram = capture.next();
        if (!datagram) {
            fail(datagram.error());
            if (live) return std::nullopt;
        }
        // What came before a damaged place of a file counts.
        if (!datagram || capture.ended()) break;
        if (*datagram) check.add(**datagram);
    }
    return check;
}

int LidarCommand::run_watch(const std::string& instance) const {
    auto capture = Capture::open_interface(interface_);
    if (!capture) return fail(capture.error(), EX_UNAVAILABLE);
    std::map<std::string, LidarVerdict> known;
    std::string unheard;  // why the service did not hear the last report
    for (;;) {
        const auto check = look(*capture, true);
        if (!check) return EX_IOERR;
        if (stop_()) return EX_OK;
        const auto reports = worth_reporting(check->reports());
        std::vector<LidarReport> changed;
        std::map<std::string, LidarVerdict> now;
        for (const LidarReport& report : reports) {
            now[report.source] = report.verdict;
            const auto before = known.find(report.source);
            if (before == known.end() || before->second != report.verdict)
                changed.push_back(report);
        }
        known = std::move(now);
        fmt::print("{}", json_ ? lidar_json(reports).dump() + "\n" : lidar_text(changed));
        std::fflush(stdout);
        const std::string problem = reported(reports, interface_, instance);
        if (!problem.empty() && problem != unheard) fmt::print(stderr, "versavis: {}\n", problem);
        unheard = problem;
    }
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
    const auto check = look(*capture, live);
    if (!check) return EX_IOERR;
    if (const auto dropped = capture->dropped(); dropped > 0)
        fmt::print(stderr, "versavis: {} frames were not read in time\n", dropped);
    const auto reports = check->reports();
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
