// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis clock`: state of the board's clock, and its estimation again from recordings.
#pragma once

#include <CLI/App.hpp>
#include <string>

#include "clock_plot.hpp"
#include "clock_replay.hpp"

namespace versavis::client {

class ClockCommands {
 public:
    /// Adds the command and its subcommands to the options of the program.
    explicit ClockCommands(CLI::App& app);
    ClockCommands(const ClockCommands&) = delete;  // options write to the members
    ClockCommands& operator=(const ClockCommands&) = delete;

    /// After parsing: the user asked for one of them.
    bool chosen() const;

    /// Does it and returns the program's exit code.
    int run(const std::string& instance);

 private:
    void add_status();
    void add_replay();
    void add_plot();
    int show_status(const std::string& instance) const;
    int replay();
    int plot();

    CLI::App* clock_;
    CLI::App* status_ = nullptr;
    CLI::App* replay_ = nullptr;
    bool json_ = false;
    EstimatorKind estimator_ = EstimatorKind::envelope;
    bool fair_start_ = false;
    ClockReplaySettings replay_settings_;
    ClockPlotSettings plot_settings_;
};

}  // namespace versavis::client
