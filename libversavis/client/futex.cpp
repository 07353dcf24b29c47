// SPDX-License-Identifier: BSD-3-Clause
#include "client/futex.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <ctime>

namespace versavis::ring {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

// How long a kernel without futex_waitv sleeps on one word of several. If lower, more wake-ups of
// an idle program; if higher, items of the other streams are seen later.
constexpr std::int64_t blind_sleep_ns = 1'000'000;

// Of <linux/futex.h> and <sys/syscall.h> since Linux 5.16, which may be older where this is
// compiled than where it runs.
constexpr long futex_waitv_number = 449;
constexpr std::uint32_t futex_32 = 2;
struct FutexWaiter {
    std::uint64_t value;
    std::uint64_t address;
    std::uint32_t flags;
    std::uint32_t reserved;
};

/// Kernels before 5.16 do not know of several words, and some containers do not let it through.
bool cannot_wait_for_any(long result) {
    return result == -1 && (errno == ENOSYS || errno == EPERM);
}

}  // namespace

int futex_wake(const std::atomic<std::uint32_t>& word, int count) {
    return static_cast<int>(syscall(SYS_futex, &word, FUTEX_WAKE, count));
}

void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                std::int64_t timeout_ns) {
    const timespec timeout{timeout_ns / second_ns, timeout_ns % second_ns};
    syscall(SYS_futex, &word, FUTEX_WAIT, value, &timeout);
}

void futex_wait_any(const std::vector<FutexWord>& words, std::int64_t timeout_ns) {
    std::array<FutexWaiter, most_futex_words> waiters{};
    const auto count = static_cast<std::ptrdiff_t>(std::min(words.size(), waiters.size()));
    std::transform(words.begin(), words.begin() + count, waiters.begin(), [](const FutexWord& one) {
        return FutexWaiter{one.value, reinterpret_cast<std::uintptr_t>(one.word), futex_32, 0};
    });
    timespec until{};
    clock_gettime(CLOCK_MONOTONIC, &until);
    const std::int64_t ns = until.tv_nsec + timeout_ns;
    until.tv_sec += ns / second_ns;
    until.tv_nsec = ns % second_ns;
    const long result = words.empty()
                            ? clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr)
                            : syscall(futex_waitv_number, waiters.data(),
                                      static_cast<unsigned>(count), 0, &until, CLOCK_MONOTONIC);
    if (cannot_wait_for_any(result))
        futex_wait(*words.front().word, words.front().value, std::min(timeout_ns, blind_sleep_ns));
}

}  // namespace versavis::ring
