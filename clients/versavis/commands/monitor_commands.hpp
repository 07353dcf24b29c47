// SPDX-License-Identifier: BSD-3-Clause
// "versavis check" and "versavis metrics": the state of the service for monitoring systems.
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace versavis::client {

class MonitorCommands {
 public:
    explicit MonitorCommands(CLI::App& app);
    MonitorCommands(const MonitorCommands&) = delete;  // options write to the members
    MonitorCommands& operator=(const MonitorCommands&) = delete;

    bool chosen() const { return check_->parsed() || metrics_->parsed(); }

    /// Runs the chosen command; returns the program's exit code.
    int run(const std::string& instance) const;

 private:
    int metrics(const std::string& instance) const;

    CLI::App* check_;
    CLI::App* metrics_;
    std::string output_;
};

}  // namespace versavis::client
