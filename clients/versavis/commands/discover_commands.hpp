// SPDX-License-Identifier: BSD-3-Clause
// The commands `versavis discover` and `versavis init`: which devices are there, and a
// configuration for them.
#pragma once

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "discovery/new_configuration.hpp"

namespace versavis::client {

class DiscoverCommands {
 public:
    explicit DiscoverCommands(CLI::App& app);
    DiscoverCommands(const DiscoverCommands&) = delete;  // options write to the members
    DiscoverCommands& operator=(const DiscoverCommands&) = delete;

    bool chosen() const;

    /// Runs the chosen command; returns the program's exit code.
    int run(const std::string& instance);

 private:
    void add_discover(CLI::App& app);
    void add_init(CLI::App& app);
    int discover() const;
    int init(const std::string& instance);
    std::vector<std::string> all_addresses() const;
    Expected<NewConfiguration> choose(const nlohmann::json& devices,
                                      const std::string& instance) const;
    /// False: the user gave up.
    bool ask(const nlohmann::json& devices, NewConfiguration& configuration);
    bool ask_imu(NewConfiguration& configuration) const;
    int write(const NewConfiguration& configuration, const std::string& text) const;

    CLI::App* discover_ = nullptr;
    CLI::App* init_ = nullptr;
    bool json_ = false;
    std::vector<std::string> addresses_;
    std::vector<std::string> cameras_;
    std::string output_;
    bool force_ = false;
    bool yes_ = false;
    double rate_hz_ = 0;  ///< 0: not given
    std::string imu_;
    std::string link_ = "usb";
    std::string serial_;
};

}  // namespace versavis::client
