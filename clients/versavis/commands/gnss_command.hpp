// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis gnss match`.
#pragma once

#include <CLI/App.hpp>
#include <string>

#include "gnss/gnss_match.hpp"

namespace versavis::client {

class GnssCommand {
 public:
    explicit GnssCommand(CLI::App& app);
    GnssCommand(const GnssCommand&) = delete;  // options write to the members
    GnssCommand& operator=(const GnssCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Returns the program's exit code.
    int run() const;

 private:
    CLI::App* command_;
    GnssMatchSettings settings_;
    std::string recording_;
    std::string marks_;
    std::string csv_;
    bool falling_ = false;
    bool json_ = false;
};

}  // namespace versavis::client
