// SPDX-License-Identifier: BSD-3-Clause
// "versavis graph": every clock that stamps depend on.
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace versavis::client {

class GraphCommand {
 public:
    explicit GraphCommand(CLI::App& app);
    GraphCommand(const GraphCommand&) = delete;  // options write to the members
    GraphCommand& operator=(const GraphCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Runs the command; returns the program's exit code. `named`: the instance was chosen, else
    /// all of this computer are shown.
    int run(const std::string& instance, bool named) const;

 private:
    CLI::App* command_;
    bool json_ = false;
};

}  // namespace versavis::client
