// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis evaluate`: what a recording says about the synchronisation.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>
#include <vector>

#include "evaluate/led_evaluation.hpp"
#include "sensor_commands.hpp"

namespace versavis::client {

class EvaluateCommands {
 public:
    /// Adds the command and its subcommands to the options of the program; `stop` returns true
    /// when the program is to end.
    EvaluateCommands(CLI::App& app, std::function<bool()> stop);
    EvaluateCommands(const EvaluateCommands&) = delete;  // options write to the members
    EvaluateCommands& operator=(const EvaluateCommands&) = delete;

    /// After parsing: the user chose one of these commands.
    bool chosen() const;

    /// Runs the chosen command; returns the program's exit code.
    int run();

 private:
    void add_leds();
    int run_leds();
    bool progress(std::size_t frames) const;

    CLI::App* evaluate_;
    CLI::App* leds_ = nullptr;
    std::function<bool()> stop_;
    SensorCommands sensors_;
    std::string recording_;
    bool json_ = false;
    std::vector<std::string> cameras_;
    std::vector<std::string> boards_;
    std::vector<std::string> exposures_;
    double led_rate_hz_ = 0;  ///< 0: as the recording says
    bool backward_ = false;
    bool high_first_ = false;
};

}  // namespace versavis::client
