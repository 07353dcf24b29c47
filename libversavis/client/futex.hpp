// SPDX-License-Identifier: BSD-3-Clause
// Sleeps on words in shared memory, and wakes sleepers in any process. std::atomic::wait and notify
// reach this process only.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace versavis::ring {

/// A sleeper looks again after this long in any case: a process with a read-only mapping can move
/// sleepers to another word, and a killed writer wakes nobody. If lower, more idle wake-ups; if
/// higher, a death is reported later.
constexpr std::int64_t longest_sleep_ns = 20'000'000;

/// Wakes up to `count` sleepers on `word`, and says how many.
int futex_wake(const std::atomic<std::uint32_t>& word, int count);

/// Sleeps until `word` is no longer `value`, or `timeout_ns` has passed; may also return early.
void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                std::int64_t timeout_ns);

struct FutexWord {
    const std::atomic<std::uint32_t>* word;
    std::uint32_t value;
};

/// How many words one call of futex_wait_any can sleep on.
constexpr std::size_t most_futex_words = 128;

/// Sleeps until one of the words, of the first 128 at most, has no longer its value, or
/// `timeout_ns` has passed; may also return early. Kernels before 5.16 cannot: there it sleeps on
/// the first one, for a millisecond.
void futex_wait_any(const std::vector<FutexWord>& words, std::int64_t timeout_ns);

}  // namespace versavis::ring
