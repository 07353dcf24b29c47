// SPDX-License-Identifier: BSD-3-Clause
// "versavis start|stop|restart|set|reload": changes a service that runs.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "control/control_client.hpp"

namespace versavis::client {

class ControlCommands {
 public:
    explicit ControlCommands(CLI::App& app);

    bool chosen() const;
    int run(const std::string& instance);

 private:
    CLI::App* add(CLI::App& app, const char* name, const char* description);
    Expected<nlohmann::json> carry_out(ControlClient& service) const;
    void report(const nlohmann::json& result) const;

    CLI::App* start_;
    CLI::App* stop_;
    CLI::App* restart_;
    CLI::App* set_;
    CLI::App* reload_;
    std::string camera_;
    std::vector<std::string> values_;
    bool json_ = false;
};

}  // namespace versavis::client
