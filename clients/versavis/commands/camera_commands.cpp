// SPDX-License-Identifier: BSD-3-Clause
#include "camera_commands.hpp"

#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <vector>

#include "posix/child_process.hpp"

namespace versavis::client {

CameraCommands::CameraCommands(CLI::App& app) {
    auto* camera =
        app.add_subcommand("camera", "Probe cameras or check their wiring, without the service");
    camera->require_subcommand(1);
    probe_ = camera->add_subcommand(
        "probe",
        "Set up one camera as the service would, and show what it is, what was set and what is "
        "wrong. Exits 0 if it is ready. The service must not be using it");
    probe_
        ->add_option("device", device_,
                     "IP or MAC address, serial number or name; all: every camera")
        ->required();
    probe_->add_option("--config", configuration_,
                       "Use the camera's keys in this configuration file of the service");
    probe_->add_option("--bundle", bundle_,
                       "Also write the GenICam description, all feature values and a draft preset "
                       "to this file, to attach to a report");
    probe_->add_flag("--json", json_, "Print one JSON object per camera");
    check_ = camera->add_subcommand(
        "check",
        "Verify the wiring of all cameras by pulsing one output at a time: trigger lines, exposure "
        "lines, polarity, delays, lost triggers, swapped cables. Takes a minute. Stop the service "
        "first. Exits 0 if all is right");
    check_->add_option("--config", configuration_,
                       "Configuration file of the service (default: the installed one)");
    check_->add_flag("--json", json_, "Print one JSON object");
}

int CameraCommands::run() {
    const std::string program = installed_program("versavisd");
    std::vector<std::string> arguments{program, "--check-cameras"};
    if (probe_->parsed()) arguments = {program, "--probe-camera", device_};
    if (!configuration_.empty()) arguments.insert(arguments.end(), {"--config", configuration_});
    if (!bundle_.empty()) arguments.insert(arguments.end(), {"--bundle", bundle_});
    if (json_) arguments.emplace_back("--json");
    std::vector<char*> pointers;
    for (std::string& argument : arguments) pointers.push_back(argument.data());
    pointers.push_back(nullptr);
    ::execv(program.c_str(), pointers.data());
    fmt::print(stderr, "versavis: {}: cannot be run: {}; install the service beside this program\n",
               program, std::generic_category().message(errno));
    return EX_UNAVAILABLE;
}

}  // namespace versavis::client
