// SPDX-License-Identifier: BSD-3-Clause
#include "control_commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sysexits.h>

namespace versavis::client {

using nlohmann::json;

namespace {

/// A number, true, false, a list or null; anything else is a text.
json value_of(const std::string& text) {
    json value = json::parse(text, nullptr, false);
    return value.is_discarded() || value.is_object() ? json(text) : value;
}

/// Error: one is not of the form KEY=VALUE.
Expected<json> values_of(const std::vector<std::string>& texts) {
    json values = json::object();
    for (const std::string& text : texts) {
        const std::size_t equals = text.find('=');
        if (equals == 0 || equals == std::string::npos)
            return failure(text, "is not of the form KEY=VALUE", "such as rate_hz=30");
        values[text.substr(0, equals)] = value_of(text.substr(equals + 1));
    }
    return values;
}

}  // namespace

CLI::App* ControlCommands::add(CLI::App& app, const char* name, const char* description) {
    CLI::App* command = app.add_subcommand(name, description);
    command->add_flag("--json", json_, "Print the reply as JSON (docs/contracts/control.md)");
    return command;
}

ControlCommands::ControlCommands(CLI::App& app) {
    start_ = add(app, "start", "Start a camera that was stopped");
    stop_ = add(app, "stop",
                "Stop a camera: the service lets it go until it is started, or restarts itself");
    restart_ = add(app, "restart", "Open and set up a camera anew");
    set_ = add(app, "set",
               "Change values of a camera while the service runs, until it restarts. Exposure and "
               "gain change while frames come, other values with a pause of this camera; those of "
               "the board, such as rate_hz, pause all cameras that it triggers");
    for (CLI::App* command : {start_, stop_, restart_, set_})
        command->add_option("camera", camera_, "Name of the camera")->required();
    set_->add_option("values", values_,
                     "KEY=VALUE: keys of [[camera]], auto_exposure.KEY, or features of the camera "
                     "such as ExposureTime=5000; KEY=null: its default")
        ->required();
    reload_ = add(app, "reload",
                  "Read the configuration file again, and take over what can change while the "
                  "service runs. A file with an error changes nothing");
}

bool ControlCommands::chosen() const {
    return start_->parsed() || stop_->parsed() || restart_->parsed() || set_->parsed() ||
           reload_->parsed();
}

Expected<json> ControlCommands::carry_out(ControlClient& service) const {
    if (reload_->parsed()) return service.call("Reload", json::object());
    if (start_->parsed()) return service.call("StartCamera", {{"camera", camera_}});
    if (stop_->parsed()) return service.call("StopCamera", {{"camera", camera_}});
    if (restart_->parsed()) return service.call("RestartCamera", {{"camera", camera_}});
    const auto values = values_of(values_);
    if (!values) return Unexpected(values.error());
    return service.call("SetCamera", {{"camera", camera_}, {"values", *values}});
}

void ControlCommands::report(const json& result) const {
    if (json_) return fmt::print("{}\n", result.dump());
    if (start_->parsed() || restart_->parsed()) return fmt::print("{}: opening\n", camera_);
    if (stop_->parsed()) return fmt::print("{}: stopped\n", camera_);
    const auto list = [&](const char* name) {
        return result.value(name, std::vector<std::string>());
    };
    const auto changed = list("changed");
    const auto later = list("need_restart");
    if (!changed.empty()) fmt::print("changed: {}\n", fmt::join(changed, ", "));
    if (!later.empty()) fmt::print("in force after a restart: {}\n", fmt::join(later, ", "));
    if (changed.empty() && later.empty()) fmt::print("nothing changed\n");
}

int ControlCommands::run(const std::string& instance) {
    auto service = ControlClient::connect(instance);
    const auto result = service ? carry_out(*service) : Unexpected(service.error());
    if (!result) {
        fmt::print(stderr, "versavis: {}\n", result.error().message());
        return service ? EX_DATAERR : EX_UNAVAILABLE;
    }
    report(*result);
    return EX_OK;
}

}  // namespace versavis::client
