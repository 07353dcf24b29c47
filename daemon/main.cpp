// SPDX-License-Identifier: BSD-3-Clause
// versavisd: the service.
#include <fmt/format.h>
#include <signal.h>
#include <sysexits.h>
#include <systemd/sd-daemon.h>

#include <CLI/CLI.hpp>
#include <cerrno>

#include "configuration/configuration.hpp"
#include "log.hpp"
#include "service.hpp"

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

/// Ticks until a signal asks to stop; returns it.
int serve(Service& service, const sigset_t& signals) {
    const timespec interval{0, Service::tick_interval.ns};
    Health health = Health::starting;
    for (;;) {
        const int signal = sigtimedwait(&signals, nullptr, &interval);
        if (signal == SIGINT || signal == SIGTERM) return signal;
        if (signal == SIGHUP)
            log(LogLevel::warning, "service",
                "SIGHUP does not reload the configuration: restart the service");
        service.tick();
        sd_notify(0, "WATCHDOG=1");
        if (health == service.health()) continue;
        health = service.health();
        sd_notifyf(0, "STATUS=%s", to_string(health));
        log(LogLevel::info, "service", "health: {}", to_string(health));
    }
}

int run(const std::string& path, bool check_only) {
    const sigset_t signals = block_signals();
    auto configuration = load_configuration(path);
    if (!configuration) {
        log(LogLevel::error, "configuration", "{}", configuration.error().message());
        return EX_CONFIG;
    }
    set_log_level(configuration->log_level);
    if (check_only) {
        fmt::print("{}: ok\n", path);
        return EX_OK;
    }
    auto service = Service::create(*configuration);
    if (!service) {
        log(LogLevel::error, "service", "{}", service.error().message());
        return EX_UNAVAILABLE;
    }
    (*service)->start();
    sd_notify(0, "READY=1");
    log(LogLevel::info, "service", "serving instance '{}' with {} camera(s) and {} IMU(s)",
        configuration->instance, configuration->cameras.size(), configuration->imus.size());
    const int signal = serve(**service, signals);
    sd_notify(0, "STOPPING=1");
    log(LogLevel::info, "service", "stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
    return EX_OK;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{
        "VersaVIS service: hardware-stamped camera frames and IMU samples in shared memory"};
    std::string path = default_configuration;
    bool check_only = false;
    app.add_option("-c,--config", path, "Configuration file (docs/user/configuration.md)")
        ->capture_default_str();
    app.add_flag("--check-config", check_only, "Check the configuration file and exit");
    app.set_version_flag("--version", VERSAVIS_VERSION);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    return run(path, check_only);
}
