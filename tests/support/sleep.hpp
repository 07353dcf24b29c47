// SPDX-License-Identifier: BSD-3-Clause
// Threads of this process that sleep, and the words on which they do.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <fstream>
#include <string>
#include <thread>

#include "client/futex.hpp"
#include "versavis/time.hpp"

namespace versavis::test {

/// Until the thread of this number sleeps in the kernel.
inline void await_sleep(pid_t thread) {
    const std::string path = "/proc/self/task/" + std::to_string(thread) + "/stat";
    for (std::string line; line.empty() || line[line.rfind(')') + 2] != 'S';) {
        std::ifstream file(path);
        std::getline(file, line);
        std::this_thread::yield();
    }
}

/// Wakes one that sleeps on this word, as soon as one does; false: none did for 20 s.
inline bool wake_sleeper(const std::atomic<std::uint32_t>& word) {
    const HostTime end = host_now() + seconds(20);
    while (ring::futex_wake(word, 1) == 0) {
        if (host_now() > end) return false;
        std::this_thread::yield();
    }
    return true;
}

}  // namespace versavis::test
