// SPDX-License-Identifier: BSD-3-Clause
#include "commands/wiring_command.hpp"

#include <fmt/format.h>
#include <sysexits.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>

#include "base/fail.hpp"
#include "discovery/found_devices.hpp"
#include "discovery/service_program.hpp"
#include "posix/file.hpp"
#include "status/status_document.hpp"
#include "wiring/wiring_drawing.hpp"
#include "wiring/wiring_text.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// What the service set a camera up by; without one, what is connected.
class Presets {
 public:
    explicit Presets(const std::optional<json>& status) : status_(status) {}

    std::string of(const std::string& name, const std::string& device) {
        if (status_)
            if (std::string preset = preset_of(*status_, name); !preset.empty()) return preset;
        if (!devices_) {
            fmt::print(stderr, "Looking for cameras ...\n");
            const auto found = find_devices({});
            devices_ = found ? found->value("cameras", json::array()) : json::array();
        }
        for (const json& camera : *devices_)
            if (goes_by(camera, device)) return camera.value("preset", "");
        return "";
    }

 private:
    const std::optional<json>& status_;
    std::optional<json> devices_;
};

bool are_circuits(const std::vector<std::string>& names) {
    return !names.empty() && std::all_of(names.begin(), names.end(),
                                         [](const auto& name) { return circuits().has(name); });
}

/// Whether parts of the configuration have these names, as circuits have.
bool has_parts(const std::string& path, const std::vector<std::string>& names) {
    auto parts = configured_wiring(path, [](const auto&, const auto&) { return std::string(); });
    return parts && only(std::move(*parts), names);
}

}  // namespace

WiringCommand::WiringCommand(CLI::App& app)
    : command_(app.add_subcommand(
          "wiring",
          "Show how to connect the cameras, IMUs and LiDARs of the configuration to the board, pin "
          "by pin, with levels and warnings. The circuits follow the manufacturers' figures and "
          "are not "
          "tried on hardware (docs/user/wiring.md)")) {
    command_->add_option("name", names_,
                         "Only these parts; or circuits by name, without a "
                         "configuration");
    command_->add_option("--config", configuration_,
                         "Configuration file of the service (default: the one that it has read)");
    command_->add_option("--svg", svg_, "Also write a drawing to this file");
    command_->add_flag("--list", list_, "List the circuits that are known");
    command_->add_flag("--json", json_, "Print one JSON object");
    command_->add_option("--pictures", pictures_)->group("");  // of the documents
}

Expected<WiredParts> WiringCommand::parts(const std::string& instance) const {
    std::optional<json> status;
    if (auto read = read_status(instance)) status = std::move(*read);
    const std::string path = configuration_path(configuration_, status);
    if (configuration_.empty() && are_circuits(names_) && !has_parts(path, names_))
        return named_wiring(names_);
    // Of a file with errors no wire is certain; the service says what is wrong with it.
    const auto checked = run_versavisd({"--check-config", "--config", path});
    if (!checked) return Unexpected(checked.error());
    if (checked->exit_code != EX_OK)
        return failure(path, "has errors, which stand above", "correct them, then ask again");
    Presets presets(status);
    auto all = configured_wiring(
        path, [&](const auto& name, const auto& device) { return presets.of(name, device); });
    if (!all) return all;
    if (all->empty())
        return failure(path, "has no camera, IMU or LiDAR at the board",
                       "write one with 'versavis init', or name a circuit: 'versavis wiring "
                       "--list'");
    return only(std::move(*all), names_);
}

/// Those of docs/user/wiring.md.
Expected<> WiringCommand::write_pictures(const std::string& directory) const {
    const auto write = [&](const std::string& name, const std::vector<Sheet>& sheets) {
        return write_whole_file(fmt::format("{}/wiring-{}.svg", directory, name), to_svg(sheets));
    };
    for (const char* group : {"cameras", "imus", "lidars"})
        for (const json& row : circuits_json().at(group)) {
            const auto name = row.at("name").get<std::string>();
            if (auto done = write(name, drawings(*named_wiring({name}))); !done) return done;
        }
    if (auto done = write("driven", {driven_outputs_drawing()}); !done) return done;
    return write("inverted", {inverted_trigger_drawing()});
}

int WiringCommand::run(const std::string& instance) const {
    if (!pictures_.empty()) {
        const auto written = write_pictures(pictures_);
        return written ? EX_OK : fail(written.error(), EX_CANTCREAT);
    }
    if (list_) {
        fmt::print("{}", circuits_text());
        return EX_OK;
    }
    const auto wired = parts(instance);
    if (!wired) return fail(wired.error(), EX_NOINPUT);
    if (!svg_.empty()) {
        if (auto written = write_whole_file(svg_, to_svg(drawings(*wired))); !written)
            return fail(written.error(), EX_CANTCREAT);
    }
    fmt::print("{}", json_ ? wiring_json(*wired).dump() + "\n" : wiring_text(*wired));
    const auto known = [](const auto& part) { return part.circuit != nullptr; };
    const bool all = std::all_of(wired->cameras.begin(), wired->cameras.end(), known) &&
                     std::all_of(wired->imus.begin(), wired->imus.end(), known) &&
                     std::all_of(wired->lidars.begin(), wired->lidars.end(), known);
    return all ? EX_OK : EXIT_FAILURE;
}

}  // namespace versavis::client
