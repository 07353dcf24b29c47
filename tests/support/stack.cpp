// SPDX-License-Identifier: BSD-3-Clause
#include "stack.hpp"
#include "look.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <stdexcept>

namespace versavis::test {

Stack::Stack(const StackSettings& settings) : settings_(settings) {
    std::string scenario = "imu = \"imu0\"\n";
    const std::string link = settings.link.empty() ? "unix:" + socket_path() : settings.link;
    std::string configuration =
        fmt::format("instance = \"{}\"\nstate_directory = \"{}\"\n[board]\nlink = \"{}\"\n",
                    settings_.name, directory_.path().string(), link);
    const auto at = [](const std::vector<std::string>& texts, unsigned i) {
        return i < texts.size() ? texts[i] : std::string();
    };
    const auto address = [&](unsigned i) {
        return fmt::format("127.0.{}.{}", settings.subnet, i + 2);
    };
    for (unsigned i = 0; i < settings.cameras; ++i) {
        if (i + settings.absent < settings.cameras)
            scenario += fmt::format(
                "[[camera]]\nname = \"cam{0}\"\naddress = \"{1}\"\noutput = {0}\nwidth = "
                "{2}\nheight = "
                "{3}\n{4}\n{5}\n",
                i, address(i), settings.width, settings.height, settings.camera_scenario,
                at(settings.scenarios, i));
        const bool slave = i > 0 && !settings.slave_extra.empty();
        const unsigned real = settings.swapped ? settings.cameras - 1 - i : i;
        configuration += fmt::format(
            "[[camera]]\nname = \"cam{0}\"\ndevice = \"{1}\"\noutput = {0}\nlatency_us = "
            "20\npacket_size = "
            "9000\n"
            "{2}\n{3}\n{4}\n{5}\n",
            i, at(settings.devices, i).empty() ? address(real) : at(settings.devices, i),
            slave ? settings.slave_extra : fmt::format("rate_hz = {}", settings.rate_hz),
            settings.lines, settings.camera_extra, at(settings.extras, i));
    }
    configuration += "[[imu]]\nname = \"imu0\"\n" + settings.imu_extra;
    scenario_path_ = directory_.write("scenario.toml", scenario + settings.faults);
    configuration_path_ = directory_.write("versavis.toml", configuration);
    auto loaded = rig::load_scenario(scenario_path_);
    if (!loaded) throw std::runtime_error(loaded.error().message());
    scenario_ = *loaded;
}

Stack::~Stack() {
    if (service_) service_->terminate();
    std::error_code ignored;
    std::filesystem::remove_all(instance_directory(settings_.name), ignored);
}

void Stack::start_rig() {
    rig_ = std::make_unique<Process>(
        std::vector<std::string>{program("versavis-rig"), "run", scenario_path_, "--socket",
                                 socket_path(), "--truth", truth_path(), "--board",
                                 settings_.board},
        log_path("rig.log"));
    if (!rig_->wait_for_output("rig ready", seconds(20)))
        throw std::runtime_error("rig: " + rig_->output());
}

void Stack::start_service() {
    service_ = std::make_unique<Process>(
        std::vector<std::string>{program("versavisd"), "--config", configuration_path_},
        log_path("versavisd.log"));
    if (!service_->wait_for_output("serving instance", seconds(20)))
        throw std::runtime_error("service: " + service_->output());
}

rig::JudgeSettings Stack::judging(double seconds) const {
    rig::JudgeSettings settings;
    settings.instance = instance();
    settings.truth_path = truth_path();
    settings.seconds = seconds;
    return settings;
}

void Stack::kill_service() {
    service_->signal(SIGKILL);
    service_->wait(seconds(10));
}

nlohmann::json Stack::wait_for_status(const std::function<bool(const nlohmann::json&)>& condition,
                                      Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    auto stream = wait_for_stream<StatusStream>("status", settings_.name);
    nlohmann::json document;
    while (host_now() < deadline) {
        const auto item = test::look(stream.next(milliseconds(500)));
        if (item.found != test::Found::item) continue;
        std::string text(item.payload.size(), '\0');
        if (!item.payload.copy_to(reinterpret_cast<std::byte*>(text.data()))) continue;
        document = nlohmann::json::parse(text);
        if (condition(document)) return document;
    }
    throw std::runtime_error("no such status in time; the last one: " + document.dump(1) + "\n" +
                             service_->output());
}

int Stack::tool(const std::vector<std::string>& arguments, std::string* output) const {
    std::vector<std::string> all{program("versavis"), "--instance", settings_.name};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return run(all, log_path("versavis.log"), output);
}

}  // namespace versavis::test
