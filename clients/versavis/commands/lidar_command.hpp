// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis lidar check`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

namespace versavis::client {

class LidarCommand {
 public:
    /// `stop` returns true when the program is to end.
    LidarCommand(CLI::App& app, std::function<bool()> stop);
    LidarCommand(const LidarCommand&) = delete;  // options write to the members
    LidarCommand& operator=(const LidarCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Returns the program's exit code.
    int run() const;

 private:
    CLI::App* command_;
    std::function<bool()> stop_;
    std::string file_;
    std::string interface_;
    double seconds_ = 10;
    bool json_ = false;
};

}  // namespace versavis::client
