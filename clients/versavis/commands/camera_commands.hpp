// SPDX-License-Identifier: BSD-3-Clause
// "versavis camera": what a camera is and how it is set up. The service's program does it, because
// it has what a camera takes.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace versavis::client {

class CameraCommands {
 public:
    explicit CameraCommands(CLI::App& app);

    bool chosen() const { return probe_->parsed() || check_->parsed(); }

    /// Becomes the other program. Returns an exit code only if that fails.
    int run();

 private:
    CLI::App* probe_;
    CLI::App* check_;
    std::string device_;
    std::string configuration_;
    std::string bundle_;
    bool json_ = false;
};

}  // namespace versavis::client
