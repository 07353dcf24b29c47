// SPDX-License-Identifier: BSD-3-Clause
// Threads that sleep on a futex word, and how many of them do.
#pragma once

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <climits>
#include <cstdint>
#include <thread>
#include <vector>

#include "client/futex.hpp"

namespace versavis::test {

/// Nothing but a wake ends their sleep, for a minute.
class Sleepers {
 public:
    /// All of them are asleep when it is made, but those whom somebody wakes at once.
    Sleepers(std::atomic<std::uint32_t>& word, int count) : word_(word), value_(word) {
        for (int i = 0; i < count; ++i)
            threads_.emplace_back([this] {
                ring::futex_wait(word_, value_, 60'000'000'000);
                ++woken_;
            });
        while (asleep() + woken_ < count) std::this_thread::yield();
    }
    /// Wakes the rest.
    ~Sleepers() {
        ring::futex_wake(word_, INT_MAX);
        for (std::thread& thread : threads_) thread.join();
    }
    Sleepers(const Sleepers&) = delete;
    Sleepers& operator=(const Sleepers&) = delete;

    void wait_until_all_are_woken() const {
        while (woken_ < static_cast<int>(threads_.size())) std::this_thread::yield();
    }

    /// Those who sleep there now: a move from a word to the same counts them, and wakes none.
    int asleep() const {
        return static_cast<int>(
            ::syscall(SYS_futex, &word_, FUTEX_REQUEUE, 0, static_cast<long>(INT_MAX), &word_));
    }

 private:
    std::atomic<std::uint32_t>& word_;
    const std::uint32_t value_;
    std::atomic<int> woken_{0};
    std::vector<std::thread> threads_;
};

}  // namespace versavis::test
