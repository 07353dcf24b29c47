// SPDX-License-Identifier: BSD-3-Clause
// The versavis tool: shows what the service is doing and what it publishes.
#include <fmt/format.h>
#include <signal.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <sstream>

#include "base/fail.hpp"
#include "commands/board_commands.hpp"
#include "commands/camera_commands.hpp"
#include "commands/clock.hpp"
#include "commands/control_commands.hpp"
#include "commands/discover_commands.hpp"
#include "commands/doctor_command.hpp"
#include "commands/evaluate_commands.hpp"
#include "commands/file_commands.hpp"
#include "commands/gnss_command.hpp"
#include "commands/graph_command.hpp"
#include "commands/lidar_command.hpp"
#include "commands/list.hpp"
#include "commands/monitor_commands.hpp"
#include "commands/process_command.hpp"
#include "commands/record_command.hpp"
#include "commands/snapshot.hpp"
#include "commands/tail.hpp"
#include "commands/verify_command.hpp"
#include "commands/wiring_command.hpp"
#include "pairing/pair_replay.hpp"
#include "posix/file.hpp"
#include "status/status_document.hpp"
#include "status/status_view.hpp"
#include "versavis/ring_path.hpp"

namespace {

using namespace versavis;

volatile sig_atomic_t stop_requested = 0;

/// At a start, scripts ask again instead of giving up.
constexpr int exit_starting = 2;

int exit_code(const std::string& health) {
    if (health == "ok") return EX_OK;
    return health == "starting" ? exit_starting : EXIT_FAILURE;
}

struct StatusOptions {
    bool json = false;
    bool verbose = false;
};

bool on_terminal() { return isatty(STDOUT_FILENO) != 0; }

client::Colour colour() {
    const char* refused = std::getenv("NO_COLOR");
    const bool none = !on_terminal() || (refused != nullptr && *refused != '\0');
    return none ? client::Colour::none : client::Colour::ansi;
}

struct StatusReport {
    std::string text;
    int code;
};

StatusReport report_status(const nlohmann::json& status, const StatusOptions& options) {
    const auto detail = options.verbose ? client::Detail::full : client::Detail::summary;
    return {options.json ? status.dump() + "\n" : client::status_text(status, detail, colour()),
            exit_code(status.value("health", ""))};
}

int show_status(const std::string& instance, const StatusOptions& options) {
    const auto status = client::read_status(instance);
    if (!status) return client::fail(client::explain_silence(status.error()));
    const StatusReport report = report_status(*status, options);
    fmt::print("{}", report.text);
    std::fflush(stdout);
    return report.code;
}

int watch_status(const std::string& instance, const StatusOptions& options) {
    int code = EX_OK;
    while (stop_requested == 0) {
        if (on_terminal() && !options.json) {
            const auto status = client::read_status(instance);
            const StatusReport report =
                status
                    ? report_status(*status, options)
                    : StatusReport{
                          "versavis: " + client::explain_silence(status.error()).message() + "\n",
                          EX_UNAVAILABLE};
            fmt::print("{}", client::in_place(report.text));
            std::fflush(stdout);
            code = report.code;
        } else {
            code = show_status(instance, options);
        }
        const timespec interval{1, 0};
        nanosleep(&interval, nullptr);  // a signal ends it early
    }
    return code;
}

int replay_pairing(const std::string& recording, const std::string& decisions, bool json) {
    std::ifstream file;
    std::ostringstream out;
    if (recording != "-") file.open(recording);
    if (!file) return client::fail({recording, "cannot be read", "check its name and permissions"});
    const auto summary = client::replay_pairing(recording == "-" ? std::cin : file,
                                                decisions.empty() ? nullptr : &out);
    if (!summary) return client::fail(summary.error());
    const auto written = decisions.empty() ? Expected<>() : write_whole_file(decisions, out.str());
    if (!written) return client::fail(written.error());
    fmt::print("{}", client::to_text(*summary, json));
    return EX_OK;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{
        "Inspect the VersaVIS service, record and evaluate its streams, flash and test boards"};
    app.require_subcommand(1);
    app.set_version_flag("--version", VERSAVIS_VERSION);
    std::string instance = default_instance();
    auto* instance_option =
        app.add_option("--instance", instance, "Instance of the service")->capture_default_str();
    app.fallthrough();
    bool json = false;

    client::DiscoverCommands discover(app);

    client::WiringCommand wiring(app);

    bool watch = false;
    auto* status = app.add_subcommand(
        "status",
        "Show the state of board, clock, cameras and streams. Exits 0 if all is well, "
        "1 if something is not delivering, 2 while it starts, 69 if the service is not running "
        "(docs/user/troubleshooting.md)");
    status->add_flag("--watch", watch, "Refresh every second");
    bool verbose = false;
    status->add_flag("--verbose", verbose, "Also show delays, streams, and counters that are zero");
    status->add_flag("--json", json,
                     "Print the status document as JSON (docs/contracts/status.md)");

    client::MonitorCommands monitor(app);

    client::DoctorCommand doctor(app);

    client::GraphCommand graph(app);

    auto* list = app.add_subcommand("list", "List the streams that can be read");
    list->add_flag("--json", json, "Print a JSON array");

    client::TailSettings tail;
    auto* tail_command =
        app.add_subcommand("tail", "Print the items of a stream as they arrive, one per line");
    tail_command->add_option("stream", tail.stream, "Name of the stream")->required();
    tail_command->add_option("-n,--count", tail.count, "Stop after this many items");
    tail_command->add_flag("--json", json, "Print one JSON object per line");
    tail_command->add_flag("--oldest", tail.oldest, "Start with the oldest item still in the ring");

    auto* pair = app.add_subcommand("pair", "Pair frames with exposures offline");
    pair->require_subcommand(1);
    std::string recording;
    std::string decisions;
    auto* replay = pair->add_subcommand(
        "replay",
        "Repeat the pairing from a log made with: versavis tail CAMERA-evidence --oldest --json");
    replay->add_option("recording", recording, "File to read; - for standard input")->required();
    replay->add_option("-o,--output", decisions,
                       "Write the decisions to this file, one JSON object per line");
    replay->add_flag("--json", json, "Print the summary as a JSON object");

    client::ClockCommands clock(app, [] { return stop_requested != 0; });

    client::EvaluateCommands evaluate(app, [] { return stop_requested != 0; });

    client::BoardCommands board(app, [] { return stop_requested != 0; });

    client::CameraCommands camera(app);

    client::GnssCommand gnss(app);

    client::LidarCommand lidar(app, [] { return stop_requested != 0; });

    client::ControlCommands control(app);

    client::ProcessCommand process(app, [] { return stop_requested != 0; });

    client::VerifyCommand verify(app, [] { return stop_requested != 0; });

    client::FileCommands files(app, [] { return stop_requested != 0; });

    client::RecordCommand recorder(app, [] { return stop_requested != 0; });

    std::string stream;
    std::string output;
    double timeout_s = 5;
    auto* snapshot =
        app.add_subcommand("snapshot", "Write the next frame of a stream to a PNG file");
    snapshot->add_option("stream", stream, "Name of the stream")->required();
    snapshot->add_option("-o,--output", output, "File to write")->required();
    snapshot->add_option("--timeout", timeout_s, "Seconds to wait for a frame")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();

    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    // Commands that run until they are stopped end tidily; all others end at once.
    if (watch || *tail_command || clock.records() || board.chosen() || lidar.chosen() ||
        evaluate.chosen() || process.chosen() || verify.chosen() || files.chosen() ||
        recorder.chosen())
        for (const int number : {SIGINT, SIGTERM}) signal(number, [](int) { stop_requested = 1; });
    signal(SIGXFSZ, SIG_IGN);  // a limit on files is reported like a full disk
    if (*status)
        return watch ? watch_status(instance, {json, verbose})
                     : show_status(instance, {json, verbose});
    if (wiring.chosen()) return wiring.run(instance);
    if (doctor.chosen()) return doctor.run(instance, VERSAVIS_VERSION);
    if (graph.chosen()) return graph.run(instance, instance_option->count() > 0);
    if (monitor.chosen()) return monitor.run(instance);
    if (*list) {
        const auto text = client::list_streams(instance, json);
        if (!text) return client::fail(text.error());
        fmt::print("{}", *text);
        return EX_OK;
    }
    if (*tail_command) {
        tail.instance = instance;
        tail.json = json;
        tail.stop = [] { return stop_requested != 0; };
        const auto done = client::tail(tail);
        return done ? EX_OK : client::fail(done.error());
    }
    if (*replay) return replay_pairing(recording, decisions, json);
    if (board.chosen()) return board.run(instance);
    if (camera.chosen()) return camera.run();
    if (gnss.chosen()) return gnss.run();
    if (lidar.chosen()) return lidar.run(instance);
    if (control.chosen()) return control.run(instance);
    if (discover.chosen()) return discover.run(instance);
    if (recorder.chosen()) return recorder.run(instance);
    if (files.chosen()) return files.run(instance_option->count() > 0 ? instance : "");
    if (evaluate.chosen()) return evaluate.run();
    if (process.chosen()) return process.run();
    if (verify.chosen()) return verify.run(instance);
    if (clock.chosen()) return clock.run(instance);
    const auto written =
        client::snapshot(instance, stream, output, {static_cast<std::int64_t>(timeout_s * 1e9)});
    if (!written) return client::fail(written.error());
    fmt::print("{}\n", *written);
    return EX_OK;
}
