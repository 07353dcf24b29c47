// SPDX-License-Identifier: BSD-3-Clause
// How far a command is, in one line on a terminal. A file would get a line for each step, so it
// gets none.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <string>

#include "versavis/time.hpp"

namespace versavis::client {

class ProgressLine {
 public:
    ~ProgressLine() { end(); }

    /// Ten times a second at most.
    void show(const std::string& text) {
        if (!terminal_) return;
        const HostTime now = host_now();
        if (now - shown_ < milliseconds(100)) return;
        shown_ = now;
        fmt::print(stderr, "\r\x1b[K{}", text);
        std::fflush(stderr);
    }

    void end() {
        if (shown_.ns != 0) fmt::print(stderr, "\r\x1b[K");
        shown_ = {};
    }

 private:
    const bool terminal_ = isatty(STDERR_FILENO) != 0;
    HostTime shown_;
};

}  // namespace versavis::client
