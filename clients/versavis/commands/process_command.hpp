// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis process`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

namespace versavis::client {

class ProcessCommand {
 public:
    /// Adds the command to the options of the program; `stop` returns true when it is to end.
    ProcessCommand(CLI::App& app, std::function<bool()> stop);
    ProcessCommand(const ProcessCommand&) = delete;  // options write to the members
    ProcessCommand& operator=(const ProcessCommand&) = delete;

    bool chosen() const;
    int run() const;

 private:
    CLI::App* command_;
    std::function<bool()> stop_;
    std::string file_;
    std::string output_;
    bool json_ = false;
};

}  // namespace versavis::client
