// SPDX-License-Identifier: BSD-3-Clause
// The commands on recordings: `versavis info`, `repair`, `export`, `play` and `calibration`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>
#include <vector>

#include "export/export.hpp"
#include "play/player.hpp"

namespace versavis::client {

class FileCommands {
 public:
    /// Adds the commands to the options of the program; `stop` returns true when the program is to
    /// end.
    FileCommands(CLI::App& app, std::function<bool()> stop);
    FileCommands(const FileCommands&) = delete;  // options write to the members
    FileCommands& operator=(const FileCommands&) = delete;

    /// After parsing: the user chose one of these commands.
    bool chosen() const;

    /// Runs the chosen command; returns the program's exit code. `instance`: empty when the user
    /// named none.
    int run(const std::string& instance);

 private:
    void add_info(CLI::App& app);
    void add_repair(CLI::App& app);
    void add_export(CLI::App& app);
    void add_play(CLI::App& app);
    void add_calibration(CLI::App& app);
    int show_info() const;
    int repair_file() const;
    int export_file();
    int play_file(const std::string& instance);
    int show_calibration() const;

    CLI::App* info_ = nullptr;
    CLI::App* repair_ = nullptr;
    CLI::App* export_ = nullptr;
    CLI::App* play_ = nullptr;
    CLI::App* calibration_ = nullptr;
    std::function<bool()> stop_;
    bool json_ = false;
    std::string file_;
    std::string output_;
    bool check_ = false;
    bool cut_ = false;
    std::string recording_;
    std::string imu_;
    ExportSettings export_settings_;
    PlaySettings play_settings_;
};

}  // namespace versavis::client
