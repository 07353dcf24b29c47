// SPDX-License-Identifier: BSD-3-Clause
// The commands `versavis flash` and `versavis board`: firmware, facts, reset and self-test of the
// board.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>
#include <vector>

#include "board/board_reset.hpp"
#include "board/flash.hpp"
#include "board/self_test.hpp"

namespace versavis::client {

class ProgressLine;

class BoardCommands {
 public:
    /// Adds the commands to the options of the program; `stop` returns true when the program is to
    /// end.
    BoardCommands(CLI::App& app, std::function<bool()> stop);
    BoardCommands(const BoardCommands&) = delete;  // options write to the members
    BoardCommands& operator=(const BoardCommands&) = delete;

    /// After parsing: the user chose one of these commands.
    bool chosen() const;

    /// Runs the chosen command; returns the program's exit code.
    int run(const std::string& instance);

 private:
    void add_flash();
    void add_info();
    void add_reset();
    void add_self_test();
    void add_choice(CLI::App& command);
    int flash_board();
    int flash_fleet(const FlashSettings& settings, ProgressLine& line);
    int show_info();
    int reset();
    int test();
    int lead_through();

    CLI::App* flash_;
    CLI::App* board_;
    CLI::App* info_ = nullptr;
    CLI::App* reset_ = nullptr;
    CLI::App* self_test_ = nullptr;
    bool json_ = false;
    BoardChoice choice_;
    std::string instance_;
    std::function<bool()> stop_;
    std::string file_;
    bool all_ = false;
    std::vector<std::string> wires_;
    bool bring_up_ = false;
};

}  // namespace versavis::client
