// SPDX-License-Identifier: BSD-3-Clause
// The command `versavis record`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

#include "record/recorder.hpp"

namespace versavis::client {

class RecordCommand {
 public:
    /// Adds the command to the options of the program; `stop` returns true when the program is to
    /// end.
    RecordCommand(CLI::App& app, std::function<bool()> stop);
    RecordCommand(const RecordCommand&) = delete;  // options write to the members
    RecordCommand& operator=(const RecordCommand&) = delete;

    /// After parsing: the user chose it.
    bool chosen() const;

    /// Returns the program's exit code.
    int run(const std::string& instance);

 private:
    CLI::App* command_;
    RecordSettings settings_;
    bool json_ = false;
    double seconds_ = 0;
    double before_s_ = 0;
    std::string split_;
    std::string compress_ = "none";
};

/// "2GiB", "500MB", "10min", "1h", "30s". Errors: neither a size nor a time.
Expected<> read_split(const std::string& text, RecordSettings& settings);

std::string to_text(const RecordReport& report, bool json);

}  // namespace versavis::client
