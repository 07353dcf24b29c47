// SPDX-License-Identifier: BSD-3-Clause
// A child process that keeps its output and does not outlive its owner.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::test {

class Process {
 public:
    /// Starts `arguments[0]`; its standard output and error go to `log`. Throws when it cannot be
    /// started.
    Process(const std::vector<std::string>& arguments, const std::string& log);
    ~Process();  ///< kills it
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;

    void signal(int number) const;

    /// Waits for its end. Returns its exit code, or 128 + the signal that ended it, or -1 when it
    /// is still running at `timeout`.
    int wait(Duration timeout);

    /// SIGTERM, then wait().
    int terminate(Duration timeout = seconds(20));

    /// Waits until its output contains `text`; false at `timeout`, or when it has ended without it.
    bool wait_for_output(const std::string& text, Duration timeout);

    std::string output() const;
    pid_t pid() const { return pid_; }

 private:
    std::string log_;
    pid_t pid_ = -1;
    int code_ = -1;
};

/// Runs a program to its end and returns its exit code; `output` receives what it printed on both
/// streams.
int run(const std::vector<std::string>& arguments, const std::string& log,
        std::string* output = nullptr);

/// Path of a program of this build.
std::string program(const std::string& name);

}  // namespace versavis::test
