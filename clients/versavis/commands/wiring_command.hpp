// SPDX-License-Identifier: BSD-3-Clause
// "versavis wiring": how to connect the cameras and IMUs of a configuration to the board.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "wiring/wired_parts.hpp"

namespace versavis::client {

class WiringCommand {
 public:
    explicit WiringCommand(CLI::App& app);
    WiringCommand(const WiringCommand&) = delete;  // options write to the members
    WiringCommand& operator=(const WiringCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Returns the program's exit code.
    int run(const std::string& instance) const;

 private:
    Expected<WiredParts> parts(const std::string& instance) const;
    Expected<> write_pictures(const std::string& directory) const;

    CLI::App* command_;
    std::vector<std::string> names_;
    std::string configuration_;
    std::string svg_;
    std::string pictures_;
    bool list_ = false;
    bool json_ = false;
};

}  // namespace versavis::client
