// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis clock`: state of the board's clock, recordings of its stamps, and
// the estimate made again from them.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

#include "clock/clock_history.hpp"
#include "clock/clock_record.hpp"
#include "clock/clock_replay.hpp"

namespace versavis::client {

class ClockCommands {
 public:
    /// Adds the command and its subcommands to the options of the program; `stop` returns
    /// true when the program is to end.
    ClockCommands(CLI::App& app, std::function<bool()> stop);
    ClockCommands(const ClockCommands&) = delete;  // options write to the members
    ClockCommands& operator=(const ClockCommands&) = delete;

    /// After parsing: the user chose one of the clock commands.
    bool chosen() const;
    bool records() const;  ///< one that runs until it is stopped

    /// Runs the chosen command; returns the program's exit code.
    int run(const std::string& instance);

 private:
    void add_status();
    void add_record();
    void add_replay();
    void add_history();
    int show_status(const std::string& instance) const;
    int record(const std::string& instance);
    int replay();
    int history();

    CLI::App* clock_;
    CLI::App* status_ = nullptr;
    CLI::App* record_ = nullptr;
    CLI::App* replay_ = nullptr;
    bool json_ = false;
    EstimatorKind estimator_ = EstimatorKind::envelope;
    bool fair_start_ = false;
    double recording_s_ = 0;
    ClockRecordSettings record_settings_;
    ClockReplaySettings replay_settings_;
    ClockHistorySettings history_settings_;
};

}  // namespace versavis::client
