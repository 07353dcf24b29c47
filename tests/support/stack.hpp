// SPDX-License-Identifier: BSD-3-Clause
// Rig and service as processes of one test, with addresses and names of their own.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "judge.hpp"
#include "process.hpp"
#include "scenario.hpp"
#include "temporary_directory.hpp"
#include "versavis/stream.hpp"

namespace versavis::test {

struct StackSettings {
    std::string name;     ///< of the instance, which no other test may have
    unsigned subnet = 0;  ///< cameras are at 127.0.<subnet>.<2...>
    unsigned cameras = 1;
    double rate_hz = 20;
    std::string camera_scenario;  ///< keys for each camera of the rig
    std::string faults;           ///< [[fault]] tables of the rig
    std::string camera_extra;     ///< keys for each camera of the service
    std::uint32_t width = 320;
    std::uint32_t height = 240;
    std::string link{};  ///< of the service to the board; empty: the rig's socket
    std::string
        slave_extra{};  ///< instead of a rate, for the cameras of the service after the first
    std::vector<std::string> devices{};    ///< `device` of each camera; empty: its address
    bool swapped = false;                  ///< the service takes each camera for the other
    std::vector<std::string> scenarios{};  ///< more keys of the rig, by camera
    std::vector<std::string> extras{};     ///< more keys of the service, by camera
    std::string imu_extra{};               ///< more keys of the IMU
    unsigned absent = 0;                   ///< cameras, the last ones, that the rig lacks
    std::string board = "native";          ///< of the rig
    /// What the service is configured with for the cameras' exposure lines: those of the rig are
    /// prompt.
    std::string lines = "strobe_rising_us = [0, 0]\nstrobe_falling_us = [0, 0]\n";
};

/// Everything that is configured delivers proved data.
inline bool healthy(const nlohmann::json& status) { return status["health"] == "ok"; }

class Stack {
 public:
    explicit Stack(const StackSettings& settings);
    ~Stack();

    void start_rig();
    void start_service();

    Process& rig() { return *rig_; }
    Process& service() { return *service_; }
    void stop_rig() { rig_.reset(); }
    void kill_service();

    const rig::Scenario& scenario() const { return scenario_; }
    std::string scenario_path() const { return scenario_path_; }
    std::string configuration_path() const { return configuration_path_; }
    std::string truth_path() const { return (directory_.path() / "truth.jsonl").string(); }
    std::string socket_path() const { return (directory_.path() / "board").string(); }
    std::string log_path(const std::string& name) const {
        return (directory_.path() / name).string();
    }
    const std::string& instance() const { return settings_.name; }

    /// Settings for rig::judge() on this rig and this service.
    rig::JudgeSettings judging(double seconds) const;

    /// Waits for a status document that meets the condition; throws when none does in time.
    nlohmann::json wait_for_status(const std::function<bool(const nlohmann::json&)>& condition,
                                   Duration timeout = seconds(30));

    /// Runs the `versavis` tool on this instance.
    int tool(const std::vector<std::string>& arguments, std::string* output = nullptr) const;

 private:
    StackSettings settings_;
    TemporaryDirectory directory_;
    std::string scenario_path_;
    std::string configuration_path_;
    rig::Scenario scenario_;
    std::unique_ptr<Process> rig_;
    std::unique_ptr<Process> service_;
};

/// Opens a stream as soon as it exists; throws when it does not in time.
template <class S>
S wait_for_stream(const std::string& name, const std::string& instance,
                  Duration timeout = seconds(20)) {
    const HostTime deadline = host_now() + timeout;
    for (;;) {
        auto stream = S::open(name, {{}, instance});
        if (stream) return std::move(*stream);
        if (host_now() > deadline) throw std::runtime_error(stream.error().message());
        const timespec pause{0, 5'000'000};
        nanosleep(&pause, nullptr);
    }
}

}  // namespace versavis::test
