// SPDX-License-Identifier: BSD-3-Clause
#include "graph_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "base/fail.hpp"
#include "doctor/clock_checks.hpp"
#include "doctor/host_files.hpp"
#include "engine/clock/system_clocks.hpp"
#include "status/clock_graph.hpp"
#include "status/status_document.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

/// Instances that have rings here, of services that live or not.
std::vector<std::string> instances() {
    std::vector<std::string> names;
    std::error_code error;
    const auto directory = std::filesystem::path(instance_directory(default_instance()));
    for (const auto& entry : std::filesystem::directory_iterator(directory.parent_path(), error))
        if (entry.is_directory(error)) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
}

std::string value_of(const PtpAnswer& answer, const char* key) {
    const auto found = answer.values.find(key);
    return found == answer.values.end() ? "" : found->second;
}

/// Of a ptp4l that runs and answers; the answers of the clock go to its ports.
std::vector<PtpPort> ports_of(const std::vector<PtpAnswer>& answers) {
    std::string grandmaster;
    std::optional<std::int64_t> offset_ns;
    for (const PtpAnswer& answer : answers) {
        if (answer.set == "PARENT_DATA_SET") grandmaster = value_of(answer, "grandmasterIdentity");
        const std::string offset = value_of(answer, "offsetFromMaster");
        if (answer.set == "CURRENT_DATA_SET" && !offset.empty())
            offset_ns = std::llround(std::strtod(offset.c_str(), nullptr));
    }
    std::vector<PtpPort> ports;
    for (const PtpAnswer& answer : answers) {
        if (answer.set != "PORT_DATA_SET") continue;
        const std::string state = value_of(answer, "portState");
        ports.push_back(
            {answer.port, state, grandmaster, state == "SLAVE" ? offset_ns : std::nullopt});
    }
    return ports;
}

}  // namespace

GraphCommand::GraphCommand(CLI::App& app)
    : command_(app.add_subcommand(
          "graph",
          "Show every clock that stamps depend on: what it is compared with or follows, by what "
          "path, how closely, and whether it does. Without --instance, of all services of this "
          "computer. Exits 0 if all are good, else 1")) {
    command_->add_flag("--json", json_, "Print one JSON object");
}

int GraphCommand::run(const std::string& instance, bool named) const {
    std::vector<InstanceStatus> services;
    for (const std::string& name : named ? std::vector{instance} : instances())
        if (auto status = read_status(name)) services.emplace_back(name, std::move(*status));
    const clock::KernelState kernel = clock::kernel_clocks()->kernel_state();
    std::vector<PtpPort> ports;
    if (!HostFiles().processes("ptp4l").empty())
        if (const auto answers = ask_ptp4l()) ports = ports_of(*answers);
    const auto clocks = clock_graph({kernel.synchronised, kernel.max_error.ns}, ports, services);
    fmt::print("{}", json_ ? graph_json(clocks).dump() + "\n" : graph_text(clocks));
    if (services.empty()) {
        const auto status = read_status(instance);
        if (!status) return fail(explain_silence(status.error()));
    }
    const bool good =
        std::all_of(clocks.begin(), clocks.end(), [](const auto& clock) { return clock.good; });
    return good ? EX_OK : EXIT_FAILURE;
}

}  // namespace versavis::client
