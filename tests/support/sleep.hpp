// SPDX-License-Identifier: BSD-3-Clause
// Waits until somebody sleeps: to look at them, or to wake them.
#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdint>
#include <string>
#include <thread>

#include "client/futex.hpp"
#include "threads.hpp"
#include "versavis/time.hpp"

namespace versavis::test {

/// Of <sys/syscall.h> since Linux 5.16.
constexpr long futex_waitv_number = 449;

/// Without that, nobody sleeps on several words: they are looked at now and then. Warns so.
inline bool kernel_waits_for_any() {
    const bool waits =
        ::syscall(futex_waitv_number, nullptr, 0, 0, nullptr, 0) == -1 && errno == EINVAL;
    if (!waits) WARN("not tested: this kernel cannot wait for several words");
    return waits;
}

/// Until the thread of this number sleeps in the kernel.
inline void await_sleep(pid_t thread) { Rest(std::to_string(thread)).wait(); }

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
