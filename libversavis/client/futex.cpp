// SPDX-License-Identifier: BSD-3-Clause
#include "client/futex.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>

namespace versavis::ring {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

// How long a kernel without futex_waitv sleeps on one word of several. Half: twice the wake-ups of
// an idle program. Twice: items of the other streams are seen up to 2 ms late.
constexpr std::int64_t blind_sleep_ns = 1'000'000;

}  // namespace

int futex_wake(const std::atomic<std::uint32_t>& word, int count) {
    return static_cast<int>(syscall(SYS_futex, &word, FUTEX_WAKE, count, nullptr, nullptr, 0));
}

void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                std::int64_t timeout_ns) {
    const timespec timeout{timeout_ns / second_ns, timeout_ns % second_ns};
    syscall(SYS_futex, &word, FUTEX_WAIT, value, &timeout, nullptr, 0);
}

void futex_wait_any(const FutexWord* words, std::size_t count, std::int64_t timeout_ns) {
    std::array<futex_waitv, most_futex_words> waiters{};
    count = std::min(count, most_futex_words);
    for (std::size_t i = 0; i < count; ++i) {
        waiters[i].val = words[i].value;
        waiters[i].uaddr = reinterpret_cast<std::uintptr_t>(words[i].word);
        waiters[i].flags = FUTEX_32;
    }
    timespec until{};
    clock_gettime(CLOCK_MONOTONIC, &until);
    const std::int64_t ns = until.tv_nsec + timeout_ns;
    until.tv_sec += ns / second_ns;
    until.tv_nsec = ns % second_ns;
    if (count == 0) {
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
        return;
    }
    const long woken = syscall(SYS_futex_waitv, waiters.data(), static_cast<unsigned>(count), 0,
                               &until, CLOCK_MONOTONIC);
    if (woken < 0 && (errno == ENOSYS || errno == EPERM))
        futex_wait(*words[0].word, words[0].value, std::min(timeout_ns, blind_sleep_ns));
}

}  // namespace versavis::ring
