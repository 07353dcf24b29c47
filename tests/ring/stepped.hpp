// SPDX-License-Identifier: BSD-3-Clause
// A process that is run step by step, and killed at one of them.
#pragma once

#include <sys/types.h>

#include <functional>

namespace versavis::test {

enum class Step { instruction, system_call };

/// Where the steps begin and end, in the body of a Stepped.
void mark();

class Stepped {
 public:
    /// Starts `body`, which calls mark() twice, in a process of its own, and runs it up to the
    /// first. Throws when it cannot be traced.
    explicit Stepped(const std::function<void()>& body);
    ~Stepped();
    Stepped(const Stepped&) = delete;
    Stepped& operator=(const Stepped&) = delete;

    /// Kills it after so many steps. A system call is two: entered, and left. False: it came to
    /// the second mark before; it is killed there.
    bool kill_after(unsigned steps, Step step);

 private:
    int run(int request) const;
    void kill();

    pid_t process_ = -1;
};

}  // namespace versavis::test
