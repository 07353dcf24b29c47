// SPDX-License-Identifier: BSD-3-Clause
// Something that a process of its own does, which ends as if it were killed.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <functional>

namespace versavis::test {

/// True: `body` returned true there.
inline bool in_process(const std::function<bool()>& body) {
    const pid_t child = ::fork();
    if (child == 0) ::_exit(body() ? 0 : 1);
    int status = 0;
    return ::waitpid(child, &status, 0) == child && status == 0;
}

}  // namespace versavis::test
