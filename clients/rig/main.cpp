// SPDX-License-Identifier: BSD-3-Clause
// versavis-rig: the virtual rig, and the judge of what the service makes of it.
#include <fmt/format.h>
#include <signal.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "judge.hpp"
#include "realtime.hpp"
#include "rig.hpp"
#include "versavis/ring_path.hpp"
#include "versavis/stream.hpp"

namespace {

using namespace versavis;
using namespace versavis::rig;

int fail(const Error& error, int code) {
    fmt::print(stderr, "versavis-rig: {}\n", error.message());
    return code;
}

int run(const std::string& scenario_path, const std::string& socket_path,
        const std::string& truth_path, const std::string& image) {
    // Threads inherit the mask: only sigwait() below sees these signals.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    auto scenario = load_scenario(scenario_path);
    if (!scenario) return fail(scenario.error(), EX_CONFIG);
    scenario->board.image = image;
    run_like_hardware();
    auto rig = Rig::start(*scenario, socket_path, truth_path);
    if (!rig) return fail(rig.error(), EX_UNAVAILABLE);
    fmt::print("rig ready: board at {}", socket_path);
    for (const CameraScenario& camera : scenario->cameras)
        fmt::print(", {} at {}", camera.name, camera.address);
    fmt::print("\n");
    std::fflush(stdout);
    int signal = 0;
    sigwait(&signals, &signal);
    return EX_OK;
}

volatile sig_atomic_t stop_requested = 0;

/// The newest status in one line.
std::string status_line(const std::string& instance) {
    auto stream = StatusStream::open("status", {{}, instance});
    if (!stream) return "waiting for the service";
    const char* none = "waiting for the first status";
    const auto item = stream->latest();
    if (!item) return none;
    std::string text(item->payload.size(), '\0');
    if (!item->payload.copy_to(reinterpret_cast<std::byte*>(text.data()))) return none;
    const auto status = nlohmann::json::parse(text, nullptr, false);
    if (!status.is_object()) return none;
    const auto& sigma = status["clock"]["sigma_ns"];
    std::string line = fmt::format(
        "{} | board {} | clock {} {} us", status["health"].get<std::string>(),
        status["board"]["state"].get<std::string>(), status["clock"]["state"].get<std::string>(),
        sigma.is_number() ? std::to_string(sigma.get<std::int64_t>() / 1000) : "unknown");
    for (const auto& stream_status : status["streams"])
        if (stream_status["kind"] == "frames" || stream_status["kind"] == "imu")
            line += fmt::format(" | {} {} ({:.1f} Hz)", stream_status["name"].get<std::string>(),
                                stream_status["items"].get<std::uint64_t>(),
                                stream_status["rate_hz"].get<double>());
    return line;
}

int run_judge(const std::string& scenario_path, JudgeSettings settings, bool as_json) {
    signal(SIGINT, [](int) { stop_requested = 1; });
    signal(SIGTERM, [](int) { stop_requested = 1; });
    auto scenario = load_scenario(scenario_path);
    if (!scenario) return fail(scenario.error(), EX_CONFIG);
    const bool terminal = isatty(STDOUT_FILENO) != 0;
    settings.stop_requested = [] { return stop_requested != 0; };
    settings.on_second = [&] {
        fmt::print("{}{}{}", terminal ? "\r\x1b[K" : "", status_line(settings.instance),
                   terminal ? "" : "\n");
        std::fflush(stdout);
    };
    auto verdict = judge(*scenario, settings);
    if (terminal) fmt::print("\n");
    if (!verdict) {
        if (as_json)
            fmt::print("{{\"ok\": false, \"error\": {}}}\n",
                       nlohmann::json(verdict.error().message()).dump());
        return fail(verdict.error(), EX_UNAVAILABLE);
    }
    fmt::print("{}", to_table(*verdict));
    if (as_json) fmt::print("{}\n", to_json(*verdict));
    return verdict->ok ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Virtual rig: trigger board, GigE Vision cameras and IMU without hardware"};
    app.require_subcommand(1);
    std::string scenario_path;
    std::string socket_path = "/tmp/versavis-rig.socket";
    std::string truth_path;
    std::string board = "native";
    std::string image = EmulatedChip::default_image();
    auto* run_command =
        app.add_subcommand("run", "Run the rig of a scenario until SIGINT or SIGTERM");
    run_command->add_option("scenario", scenario_path, "Scenario file (docs/user/rig.md)")
        ->required();
    run_command->add_option("--socket", socket_path, "Unix socket of the board")
        ->capture_default_str();
    run_command
        ->add_option("--board", board,
                     "native: firmware core within this process; rp2040: firmware image on the "
                     "emulated chip")
        ->check(CLI::IsMember({"native", "rp2040"}))
        ->capture_default_str();
    run_command->add_option("--image", image, "Firmware image for rp2040, .elf or .uf2")
        ->capture_default_str();
    run_command->add_option("--truth", truth_path,
                            "Write the ground truth to this file, one JSON object per line");

    JudgeSettings settings;
    settings.instance = default_instance();
    bool as_json = false;
    auto* judge_command = app.add_subcommand(
        "judge", "Compare what the service publishes with the ground truth. Exits 0 if they agree");
    judge_command->add_option("scenario", scenario_path, "Scenario file that the rig is running")
        ->required();
    judge_command
        ->add_option("--truth", settings.truth_path, "Ground truth file that the rig writes")
        ->required();
    judge_command->add_option("--instance", settings.instance, "Instance of the service")
        ->capture_default_str();
    judge_command->add_option("--seconds", settings.seconds, "Seconds to record")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    judge_command->add_flag("--json", as_json,
                            "Print the verdict as one JSON object on the last line");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    if (*run_command)
        return run(scenario_path, socket_path, truth_path, board == "native" ? "" : image);
    return run_judge(scenario_path, settings, as_json);
}
