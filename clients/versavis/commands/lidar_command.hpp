// SPDX-License-Identifier: BSD-3-Clause
// The commands `versavis lidar check`, `watch` and `phase`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <optional>
#include <string>

#include "lidar/lidar_check.hpp"
#include "lidar/lidar_phase.hpp"

namespace versavis::client {

class LidarCommand {
 public:
    /// `stop` returns true when the program is to end.
    LidarCommand(CLI::App& app, std::function<bool()> stop);
    LidarCommand(const LidarCommand&) = delete;  // options write to the members
    LidarCommand& operator=(const LidarCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Returns the program's exit code.
    int run(const std::string& instance) const;

 private:
    void add_check();
    void add_watch();
    void add_phase();
    std::optional<LidarCheck> look(Capture& capture, bool live) const;
    int run_check() const;
    int run_watch(const std::string& instance) const;
    int run_phase() const;

    CLI::App* command_;
    CLI::App* watch_ = nullptr;
    CLI::App* phase_ = nullptr;
    std::function<bool()> stop_;
    std::string file_;
    std::string interface_;
    double seconds_ = 10;
    bool json_ = false;
    LidarRotation rotation_;
    double azimuth_ = 0;
    double rate_hz_ = 0;
};

}  // namespace versavis::client
