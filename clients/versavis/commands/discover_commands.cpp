// SPDX-License-Identifier: BSD-3-Clause
#include "commands/discover_commands.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/mman.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include "base/fail.hpp"
#include "discovery/found_devices.hpp"
#include "discovery/service_program.hpp"
#include "engine/imu/imu_model.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// `versavis discover` found neither board nor camera.
constexpr int exit_nothing = 1;

constexpr double usual_rate_hz = 20;
constexpr double slowest_hz = 0.1;
constexpr double fastest_hz = 1000;

/// A line of the user, `usual` for an empty one. None: the input has ended.
std::optional<std::string> answer(const std::string& question, const std::string& usual) {
    fmt::print(stderr, "{} [{}] ", question, usual);
    std::string line;
    if (!std::getline(std::cin, line)) return std::nullopt;
    return line.empty() ? usual : line;
}

std::optional<bool> yes(const std::string& question, bool usual) {
    const auto said = answer(question, usual ? "Y/n" : "y/N");
    if (!said) return std::nullopt;
    return said->front() == 'Y' || (said->front() == 'y' && *said != "y/N");
}

std::optional<double> number(const std::string& text) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return value >= slowest_hz && value <= fastest_hz ? std::optional(value) : std::nullopt;
}

bool is_address(const std::string& text) {
    in_addr address{};
    return inet_pton(AF_INET, text.c_str(), &address) == 1;
}

Expected<json> table_of_keys() {
    const auto keys = run_versavisd({"--keys", "--json"});
    if (!keys) return Unexpected(keys.error());
    json document = json::parse(keys->output, nullptr, false);
    if (keys->exit_code == 0 && document.is_array()) return document;
    return failure("versavisd", "does not list its keys",
                   "install service and tool of the same release");
}

/// What the service says of it before it is written.
Expected<> checked(const std::string& text) {
    // The child opens it by the same number.
    const FileDescriptor file(::memfd_create("versavis.toml", 0));
    const std::string path = fmt::format("/proc/self/fd/{}", file.get());
    if (auto written = write_all(file, path, text); !written) return written;
    const auto checked = run_versavisd({"--check-config", "--json", "--config", path});
    if (!checked) return Unexpected(checked.error());
    const json report = json::parse(checked->output, nullptr, false);
    if (checked->exit_code == 0) return {};
    std::string problems;
    std::string cure;
    if (report.is_object())
        for (const json& problem : report.value("problems", json::array())) {
            problems += (problems.empty() ? "" : "; ") + problem.value("what", "");
            cure = problem.value("cure", "");
        }
    return failure("configuration", problems, cure);
}

}  // namespace

DiscoverCommands::DiscoverCommands(CLI::App& app) {
    add_discover(app);
    add_init(app);
}

void DiscoverCommands::add_discover(CLI::App& app) {
    discover_ = app.add_subcommand(
        "discover",
        "List the boards and cameras that this host can see, who uses them, and what stands in the "
        "way. Changes nothing. Exits 0 if there is any, 1 if there is none "
        "(docs/user/discover.md)");
    discover_
        ->add_option("--address", addresses_,
                     "Also ask this address, which no broadcast reaches; may be repeated")
        ->allow_extra_args(false);
    discover_->add_flag("--json", json_, "Print one JSON object");
}

void DiscoverCommands::add_init(CLI::App& app) {
    init_ = app.add_subcommand(
        "init",
        "Write a commented configuration for the devices that 'versavis discover' finds. Asks on a "
        "terminal; takes what is found otherwise. What it writes passes versavisd --check-config");
    init_->add_option("-o,--output", output_,
                      "File to write (default: standard output, or asked for on a terminal)");
    init_->add_flag("--force", force_, "Replace the file if it exists");
    init_->add_flag("-y,--yes", yes_, "Ask nothing");
    init_
        ->add_option("--camera", cameras_,
                     "Camera by serial number, address or name, and the name of its stream; in the "
                     "order of the board's outputs; may be repeated (default: all that are usable)")
        ->type_name("CAMERA[=NAME]")
        ->allow_extra_args(false);
    init_->add_option("--rate", rate_hz_, "Frames per second (default: 20)")
        ->check(CLI::Range(slowest_hz, fastest_hz));
    init_->add_option("--imu", imu_, "Model of the board's IMU, and the name of its stream")
        ->type_name("MODEL[=NAME]");
    init_->add_option("--serial", serial_, "Serial number of the board, to choose one of several");
    init_->add_option("--link", link_, "How the board is reached: usb or unix:PATH")
        ->capture_default_str();
    init_
        ->add_option("--address", addresses_,
                     "Also ask this address, which no broadcast reaches; may be repeated")
        ->allow_extra_args(false);
}

bool DiscoverCommands::chosen() const { return discover_->parsed() || init_->parsed(); }

int DiscoverCommands::run(const std::string& instance) {
    for (const std::string& address : addresses_)
        if (!is_address(address))
            return fail({address, "is no IPv4 address", "write it like 192.168.1.20"}, EX_USAGE);
    return discover_->parsed() ? discover() : init(instance);
}

int DiscoverCommands::discover() const {
    const auto devices = find_devices(addresses_);
    if (!devices) return fail(devices.error(), EX_UNAVAILABLE);
    fmt::print("{}", json_ ? devices->dump() + "\n" : devices_text(*devices));
    return anything_found(*devices) ? EX_OK : exit_nothing;
}

/// Also those by which cameras are chosen.
std::vector<std::string> DiscoverCommands::all_addresses() const {
    std::vector<std::string> all = addresses_;
    for (const std::string& camera : cameras_)
        if (const std::string which = camera.substr(0, camera.find('=')); is_address(which))
            all.push_back(which);
    return all;
}

Expected<NewConfiguration> DiscoverCommands::choose(const json& devices,
                                                    const std::string& instance) const {
    NewConfiguration configuration;
    configuration.instance = instance;
    configuration.link = link_;
    configuration.board_serial =
        serial_.empty() ? choose_board(devices["boards"], instance) : serial_;
    if (rate_hz_ > 0) configuration.rate_hz = rate_hz_;
    if (!imu_.empty()) {
        const auto imu = choose_imu(imu_);
        if (!imu) return Unexpected(imu.error());
        configuration.imu = *imu;
    }
    auto cameras = choose_cameras(devices["cameras"], cameras_, instance);
    if (!cameras) return Unexpected(cameras.error());
    configuration.cameras = std::move(*cameras);
    return configuration;
}

int DiscoverCommands::init(const std::string& instance) {
    if (!output_.empty() && !force_ && std::filesystem::exists(output_))
        return fail({output_, "exists", "choose another name, or replace it with --force"},
                    EX_CANTCREAT);
    const bool asks = !yes_ && isatty(STDIN_FILENO) != 0;
    const auto keys = table_of_keys();
    if (!keys) return fail(keys.error(), EX_UNAVAILABLE);
    if (asks) fmt::print(stderr, "Looking for boards and cameras ...\n");
    const auto devices = find_devices(all_addresses());
    if (!devices) return fail(devices.error(), EX_UNAVAILABLE);
    if (asks) fmt::print(stderr, "{}\n", devices_text(*devices));
    json chosen_from = *devices;
    if (asks && cameras_.empty()) chosen_from["cameras"] = json::array();
    auto configuration = choose(chosen_from, instance);
    if (!configuration) return fail(configuration.error(), EX_UNAVAILABLE);
    if (asks && !ask(*devices, *configuration))
        return fail({"init", "stopped", "nothing was written"}, EX_NOINPUT);
    if (configuration->cameras.empty() && !configuration->imu)
        return fail(
            {"init", "there is no camera to configure, and no IMU was named",
             "see 'versavis discover' for what stands in the way, or name an IMU with --imu"},
            EX_UNAVAILABLE);
    const std::string text = to_toml(*configuration, *keys);
    if (const auto good = checked(text); !good) return fail(good.error(), EX_CONFIG);
    return write(*configuration, text);
}

bool DiscoverCommands::ask(const json& devices, NewConfiguration& configuration) {
    std::vector<NewCamera>& cameras = configuration.cameras;
    for (const json& found : devices["cameras"]) {
        if (!cameras_.empty() || cameras.size() == most_cameras) break;
        NewCamera camera = new_camera(found, configuration.instance);
        const auto use =
            yes(fmt::format("Use {}?", camera.description), usable(found, configuration.instance));
        if (!use) return false;
        if (!*use) continue;
        const auto name = answer("Name of its stream?", fmt::format("cam{}", cameras.size()));
        if (!name) return false;
        camera.name = *name;
        cameras.push_back(std::move(camera));
    }
    while (rate_hz_ <= 0 && !cameras.empty()) {
        const auto said = answer("Frames per second?", fmt::format("{}", usual_rate_hz));
        if (!said) return false;
        if (const auto rate = number(*said))
            configuration.rate_hz = rate_hz_ = *rate;
        else
            fmt::print(stderr, "A number from {} to {}.\n", slowest_hz, fastest_hz);
    }
    if (imu_.empty() && !ask_imu(configuration)) return false;
    if (!output_.empty() || isatty(STDOUT_FILENO) == 0) return true;
    const auto file = answer("Write to which file?", "versavis.toml");
    if (!file) return false;
    output_ = *file;
    return true;
}

bool DiscoverCommands::ask_imu(NewConfiguration& configuration) const {
    for (;;) {
        const auto said = answer(
            fmt::format("IMU at the board ({})?", fmt::join(imu::model_names(), ", ")), "none");
        if (!said) return false;
        if (*said == "none") return true;
        const auto imu = choose_imu(*said);
        if (imu) {
            configuration.imu = *imu;
            return true;
        }
        fmt::print(stderr, "{}\n", imu.error().message());
    }
}

int DiscoverCommands::write(const NewConfiguration& configuration, const std::string& text) const {
    if (output_.empty() || output_ == "-") {
        fmt::print("{}", text);
        return std::fflush(stdout) == 0 ? EX_OK : EX_IOERR;
    }
    const auto written = force_ ? write_whole_file(output_, text) : write_new_file(output_, text);
    if (!written) return fail(written.error(), EX_CANTCREAT);
    fmt::print(stderr, "{}: {} camera{}{}\n", output_, configuration.cameras.size(),
               configuration.cameras.size() == 1 ? "" : "s",
               configuration.imu ? " and the IMU " + configuration.imu->name : "");
    return EX_OK;
}

}  // namespace versavis::client
