// SPDX-License-Identifier: BSD-3-Clause
// versavisd: the service.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>
#include <sysexits.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdlib>
#include <memory>

#include "base/library_log.hpp"
#include "base/log.hpp"
#include "base/memory_lock.hpp"
#include "base/thread_watch.hpp"
#include "camera/camera_list.hpp"
#include "camera/camera_probe.hpp"
#include "camera/description_check.hpp"
#include "check/camera_check.hpp"
#include "control/control.hpp"
#include "engine/toml/service_file.hpp"
#include "health/health_log.hpp"
#include "posix/file.hpp"
#include "service.hpp"
#include "settings/configuration.hpp"
#include "settings/key_report.hpp"
#include "settings/problem_report.hpp"
#include "versavis/ring_path.hpp"

namespace {

using namespace versavis;
using namespace versavis::daemon;

constexpr auto default_configuration = VERSAVIS_SYSCONFDIR "/versavis/versavis.toml";

/// Signals that this service handles, blocked in all threads: they are only taken by the main loop.
sigset_t block_signals() {
    sigset_t signals;
    sigemptyset(&signals);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    return signals;
}

void log_problems(const TomlProblems& problems) {
    for (const TomlProblem& problem : problems)
        log(LogLevel::error, "configuration", "{}", problem.message());
}

/// Who may control the service, beside its own user (systemd/versavis.sysusers).
constexpr auto admin_group = "versavis-admin";

/// In the log: a service manager that reloads does not ask for more.
void reload(Control& control) {
    sd_notify(0, "RELOADING=1");
    const auto done = control.reload();
    sd_notify(0, "READY=1");
    if (!done) {
        log_problems(done.error());
        return log(LogLevel::error, "configuration", "not reloaded: the old one stays in force");
    }
    log(LogLevel::info, "configuration", "reloaded: {}",
        done->changed.empty() ? "nothing changed" : fmt::to_string(fmt::join(done->changed, ", ")));
    if (!done->need_restart.empty())
        log(LogLevel::warning, "configuration", "changed, but in force only after a restart: {}",
            fmt::join(done->need_restart, ", "));
}

/// Without a socket the service serves as well.
ControlSocket make_socket(const std::string& instance) {
    auto socket = ControlSocket::create(control_path(instance), admin_group);
    if (socket) return std::move(*socket);
    log(LogLevel::error, "service", "cannot be controlled: {}", socket.error().message());
    return {};
}

/// Asks for another time of grace, unless a thread is stuck: then the service manager is to restart
/// the service.
void feed_watchdog(std::string& reported) {
    const std::string stuck = thread_watch().stuck(host_now()).value_or("");
    if (stuck.empty()) sd_notify(0, "WATCHDOG=1");
    if (stuck != reported && !stuck.empty())
        log(LogLevel::error, "service", "thread '{}' is stuck: the watchdog is to restart all",
            stuck);
    reported = stuck;
}

/// Ticks until a signal asks to stop; returns it.
int serve(Service& service, Control& control, const sigset_t& signals) {
    const timespec interval{0, Service::tick_interval.ns};
    HealthLog health_log;
    std::string status;
    std::string stuck;
    for (;;) {
        const int signal = sigtimedwait(&signals, nullptr, &interval);
        if (signal == SIGINT || signal == SIGTERM) return signal;
        if (signal == SIGHUP) reload(control);
        service.tick();
        control.tick(service.health(), host_now());
        report_suppressed_library_lines(host_now());
        feed_watchdog(stuck);
        const Summary& health = service.health();
        if (const auto level = health_log.see(health, host_now()))
            log_line(*level, "service", "health: " + health.text, to_string(health.fault));
        if (status == health.text) continue;
        status = health.text;
        sd_notifyf(0, "STATUS=%s", status.c_str());
    }
}

bool serves(const Configuration& configuration) {
    return !configuration.cameras.empty() || !configuration.imus.empty() ||
           !configuration.time_outputs.empty();
}

constexpr auto serves_nothing =
    "it has no camera, no IMU and no time output, so nothing is served; add a [[camera]] with "
    "'name' and 'device', an [[imu]] with 'model', or a [[time_output]]";

int check(const std::string& path, bool as_json) {
    const auto configuration = load_configuration(path);
    const TomlProblems problems = configuration ? TomlProblems{} : configuration.error();
    const std::vector<std::string> files =
        service_files(path).value_or(std::vector<std::string>{path});
    if (as_json) {
        fmt::print("{}\n", to_json(files, problems));
        return problems.empty() ? EX_OK : EX_CONFIG;
    }
    if (problems.empty() && !serves(*configuration))
        fmt::print("{}: ok, but {}\n", path, serves_nothing);
    else if (problems.empty())
        fmt::print("{}: ok\n", path);
    else
        log_problems(problems);
    for (std::size_t i = 1; i < files.size(); ++i) fmt::print("with {}\n", files[i]);
    return problems.empty() ? EX_OK : EX_CONFIG;
}

/// One that is handled, or 0 after so long; the watchdog is served meanwhile.
int signal_within(Duration length, const sigset_t& signals) {
    const timespec interval{1, 0};
    for (const HostTime end = host_now() + length; host_now() < end;) {
        sd_notify(0, "WATCHDOG=1");
        const int signal = sigtimedwait(&signals, nullptr, &interval);
        if (signal > 0) return signal;
    }
    return 0;
}

/// As after an installation.
Error serves_none(const std::string& path) {
    return {path, std::string(serves_nothing) + ", then reload or restart the service", ""};
}

Expected<std::unique_ptr<Service>> make_service(const Configuration& configuration) {
    if (configuration.memory.lock)
        if (const auto locked = lock_memory(); !locked) return Unexpected(locked.error());
    return Service::create(configuration);
}

/// While nothing is served: a file with an error changes nothing here, either.
void read_again(ConfigurationDocument& document, const std::string& path) {
    sd_notify(0, "RELOADING=1");
    auto next = ConfigurationDocument::load(path);
    if (next)
        document = std::move(*next);
    else
        log_problems(next.error());
    set_log_level(document.configuration.log_level);
}

/// What is missing may come: a service manager need not start the program for each attempt. A
/// terminal gets the error at once, unless a reload is all that is missing. None: stopped while it
/// waited.
Expected<std::unique_ptr<Service>> make_or_wait(ConfigurationDocument& document,
                                                const std::string& path, const sigset_t& signals) {
    constexpr Duration retry = seconds(5);
    const bool managed = std::getenv("NOTIFY_SOCKET") != nullptr;
    std::string reported;
    for (;;) {
        const bool any = serves(document.configuration);
        auto service = any ? make_service(document.configuration) : Unexpected(serves_none(path));
        if (service || (any && !managed)) return service;
        const std::string text = service.error().message();
        if (text != reported)
            log(any ? LogLevel::error : LogLevel::warning, "service", "{}{}", text,
                any ? "; trying again every 5 s" : "");
        reported = text;
        sd_notifyf(0, "READY=1\nSTATUS=waiting: %s", text.c_str());
        const int signal = signal_within(retry, signals);
        if (signal == SIGINT || signal == SIGTERM) return std::unique_ptr<Service>{};
        if (signal == SIGHUP) read_again(document, path);
    }
}

int run(const std::string& path) {
    const sigset_t signals = block_signals();
    auto document = ConfigurationDocument::load(path);
    if (!document) {
        log_problems(document.error());
        return EX_CONFIG;
    }
    const Configuration* configuration = &document->configuration;
    set_log_level(configuration->log_level);
    route_library_log();
    auto service = make_or_wait(*document, path, signals);
    if (!service) {
        log(LogLevel::error, "service", "{}", service.error().message());
        return EX_UNAVAILABLE;
    }
    if (!*service) return EX_OK;
    (*service)->start();
    Control control(make_socket(configuration->instance), *document, **service);
    sd_notify(0, "READY=1");
    log(LogLevel::info, "service", "serving instance '{}' with {} camera(s) and {} IMU(s)",
        configuration->instance, configuration->cameras.size(), configuration->imus.size());
    const int signal = serve(**service, control, signals);
    sd_notify(0, "STOPPING=1");
    log(LogLevel::info, "service", "stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
    if ((*service)->stop()) return EX_OK;
    log(LogLevel::warning, "service",
        "a device still does not answer: exiting without releasing it");
    ::_exit(EX_OK);  // its thread uses what a return would destroy
}

struct ProbeOptions {
    std::string device;  ///< or "all"
    std::string configuration;
    std::string bundle;
    bool json = false;
};

/// The camera as the configuration has it, or as one with only this device would.
CameraConfiguration camera_to_probe(const std::string& device, const Configuration& configuration) {
    for (const CameraConfiguration& known : configuration.cameras)
        if (known.device == device || known.name == device) return known;
    CameraConfiguration camera;
    camera.name = camera.device = device;
    camera.max_exposure_us = 1e6 / camera.rate_hz;
    return camera;
}

int write_bundle(const std::string& path, const std::string& text) {
    const auto written = write_whole_file(path, text + '\n');
    if (written) return EX_OK;
    fmt::print(stderr, "{}\n", written.error().message());
    return EX_CANTCREAT;
}

/// Exit code 1: something is wrong.
int check_wiring(const std::string& path, bool as_json) {
    const auto configuration = load_configuration(path);
    if (!configuration) {
        log_problems(configuration.error());
        return EX_CONFIG;
    }
    set_log_level(LogLevel::error);
    route_library_log();
    const auto report = check_cameras(
        *configuration, [](const std::string& step) { fmt::print(stderr, "{} ...\n", step); });
    if (!report) {
        fmt::print(stderr, "{}\n", report.error().message());
        return EX_UNAVAILABLE;
    }
    fmt::print("{}", as_json ? to_json(*report) + "\n" : to_text(*report));
    return report->right() ? EX_OK : EXIT_FAILURE;
}

const std::vector<ListedCamera> no_cameras;

int show_cameras(const std::vector<std::string>& addresses, bool as_json) {
    route_library_log();
    const auto presets = load_presets(default_preset_directory());
    if (!presets) {
        fmt::print(stderr, "{}\n", presets.error().message());
        return EX_UNAVAILABLE;
    }
    const auto cameras = list_cameras(addresses, *presets);
    if (!cameras) {
        fmt::print(stderr, "{}\n", cameras.error().message());
        return EX_USAGE;
    }
    fmt::print("{}", as_json ? to_json(*cameras) + "\n" : to_text(*cameras));
    return EX_OK;
}

/// Sets up one camera or all, and reports. The exit code says whether all of them are ready.
int probe(const ProbeOptions& options) {
    Configuration configuration;
    if (!options.configuration.empty()) {
        auto read = load_configuration(options.configuration);
        if (!read) {
            log_problems(read.error());
            return EX_CONFIG;
        }
        configuration = std::move(*read);
    }
    const auto presets = preset_directory(configuration);
    std::vector<std::string> devices{options.device};
    if (options.device == "all") {
        devices.clear();
        for (const ListedCamera& camera : list_cameras({}, {}).value_or(no_cameras))
            if (!camera.device.empty()) devices.push_back(camera.device);
    }
    if (devices.empty()) {
        fmt::print(stderr, "no camera answers; check cables and power, or name an address\n");
        return EX_UNAVAILABLE;
    }
    int code = EX_OK;
    std::string all;
    for (const std::string& device : devices) {
        const bool whole = !options.bundle.empty();
        const ProbeReport report =
            probe_camera(camera_to_probe(device, configuration), presets, whole);
        if (!report.problem.empty()) code = EX_UNAVAILABLE;
        fmt::print("{}", options.json ? to_json(report) + "\n" : to_text(report));
        std::fflush(stdout);
        if (whole) all += (all.empty() ? "" : ",\n") + to_json(report);
    }
    if (options.bundle.empty()) return code;
    const int written = write_bundle(options.bundle, "[" + all + "]");
    return written == EX_OK ? code : written;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{
        "VersaVIS service: publishes hardware-timestamped frames and IMU samples in shared memory"};
    std::string path = default_configuration;
    bool check_only = false;
    bool as_json = false;
    app.add_option("-c,--config", path, "Configuration file (man versavis.toml)")
        ->capture_default_str();
    CLI::Option* check_config = app.add_flag(
        "--check-config", check_only, "Check the configuration file, report every error, and exit");
    app.add_flag("--json", as_json, "Print the report as JSON");
    bool list_keys = false;
    CLI::Option* keys = app.add_flag("--keys", list_keys,
                                     "Print each configuration key with its meaning, range and "
                                     "default, and exit")
                            ->excludes(check_config);
    bool check_cables = false;
    CLI::Option* check_wires =
        app.add_flag("--check-cameras", check_cables,
                     "Verify the wiring of all cameras with test pulses, and exit")
            ->excludes(check_config)
            ->excludes(keys);
    bool list = false;
    CLI::Option* list_option = app.add_flag("--list-cameras", list,
                                            "List the cameras that can be seen, without changing "
                                            "any, and exit")
                                   ->excludes(check_config)
                                   ->excludes(keys)
                                   ->excludes(check_wires);
    std::vector<std::string> addresses;
    app.add_option("--address", addresses,
                   "Also ask this address, which no broadcast reaches; may be repeated")
        ->needs(list_option)
        ->allow_extra_args(false);
    ProbeOptions probe_options;
    app.add_option("--probe-camera", probe_options.device,
                   "Set up one camera (address, serial number or name) or 'all', report, and exit")
        ->excludes(check_config)
        ->excludes(keys)
        ->excludes(check_wires)
        ->excludes(list_option);
    app.add_option(
        "--bundle", probe_options.bundle,
        "Also write the GenICam description, feature values and a draft preset to this file");
    std::string description;  // for the service itself
    app.add_option("--probe-description", description)->group("");
    app.set_version_flag("--version", VERSAVIS_VERSION);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    if (!description.empty()) return run_description_probe(description == "zip");
    if (as_json && !check_only && !list_keys && !check_cables && !list &&
        probe_options.device.empty())
        return app.exit(CLI::RequiresError("--json",
                                           "--check-config, --keys, --check-cameras, "
                                           "--list-cameras or --probe-camera")),
               EX_USAGE;
    if (list_keys) {
        fmt::print("{}", as_json ? to_json(describe_keys()) + "\n" : to_text(describe_keys()));
        return EX_OK;
    }
    if (list) return show_cameras(addresses, as_json);
    if (check_cables) return check_wiring(path, as_json);
    if (!probe_options.device.empty()) {
        probe_options.json = as_json;
        if (app.count("--config") > 0) probe_options.configuration = path;
        return probe(probe_options);
    }
    return check_only ? check(path, as_json) : run(path);
}
