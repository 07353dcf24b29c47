// SPDX-License-Identifier: BSD-3-Clause
#include "monitor_commands.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>

#include "posix/file.hpp"
#include "status/status_check.hpp"
#include "status/status_document.hpp"
#include "status/status_metrics.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

/// The service may be well although its status cannot be read: this user may not, or it is of
/// another release.
bool may_live(const std::string& instance) {
    const std::string directory = instance_directory(instance);
    if (::access(directory.c_str(), R_OK | X_OK) != 0 && errno == EACCES) return true;
    StreamOptions options;
    options.instance = instance;
    auto stream = StatusStream::open("status", options);
    return stream && stream->reader().writer_alive();
}

int check(const std::string& instance) {
    const auto status = read_status(instance);
    const CheckResult result =
        status ? check_status(*status)
               : check_failed(explain_silence(status.error()), may_live(instance));
    fmt::print("{}\n", result.line);
    return static_cast<int>(result.state);
}

}  // namespace

MonitorCommands::MonitorCommands(CLI::App& app)
    : check_(app.add_subcommand(
          "check",
          "Check the service as a plugin of Nagios or Icinga does: one line with performance data. "
          "Exits 0 if all is well, 1 if something delivers too little, 2 if something delivers "
          "nothing or the service is not running, 3 if that is not known: it starts, or its status "
          "cannot be read")),
      metrics_(app.add_subcommand(
          "metrics",
          "Print counters and states as OpenMetrics text, for Prometheus. Without a service there "
          "is only versavis_up, which is 0 then (docs/user/monitoring.md)")) {
    metrics_->add_option("-o,--output", output_,
                         "Write to this file, whole or not at all: for the textfile collector of "
                         "node_exporter");
}

int MonitorCommands::run(const std::string& instance) const {
    return check_->parsed() ? check(instance) : metrics(instance);
}

int MonitorCommands::metrics(const std::string& instance) const {
    const auto status = read_status(instance);
    if (!status) fmt::print(stderr, "versavis: {}\n", status.error().message());
    const std::string text =
        openmetrics_text(instance, status ? std::optional(*status) : std::nullopt, host_now());
    if (output_.empty()) {
        fmt::print("{}", text);
        return EX_OK;
    }
    const auto written = write_whole_file(output_, text);
    if (written) return EX_OK;
    fmt::print(stderr, "versavis: {}\n", written.error().message());
    return EX_CANTCREAT;
}

}  // namespace versavis::client
