// SPDX-License-Identifier: BSD-3-Clause
// "versavis doctor": what of the host and the service stands in the way of right stamps.
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace versavis::client {

class DoctorCommand {
 public:
    explicit DoctorCommand(CLI::App& app);
    DoctorCommand(const DoctorCommand&) = delete;  // options write to the members
    DoctorCommand& operator=(const DoctorCommand&) = delete;

    bool chosen() const { return command_->parsed(); }

    /// Returns the program's exit code. `release`: of this program.
    int run(const std::string& instance, const std::string& release) const;

 private:
    CLI::App* command_;
    std::string configuration_;
    double seconds_ = 1;
    bool fix_ = false;
    bool json_ = false;
};

}  // namespace versavis::client
