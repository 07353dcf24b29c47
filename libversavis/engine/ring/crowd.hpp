// SPDX-License-Identifier: BSD-3-Clause
// Wakes the readers of a ring: a few at once, a crowd by a thread of its own, so that no number of
// readers holds the writer up.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

namespace versavis::ring {

/// The thread is there from the first crowd on. One thread at a time may call wake().
class Crowd {
 public:
    Crowd() = default;
    Crowd(const Crowd&) = delete;
    Crowd& operator=(const Crowd&) = delete;
    ~Crowd();  ///< waits for the thread, which uses the word

    /// Wakes all who sleep on `word`, which is the same in all calls.
    void wake(const std::atomic<std::uint32_t>& word);

 private:
    void tell();
    void call(const std::atomic<std::uint32_t>& word);
    void run(const std::atomic<std::uint32_t>& word);

    // No lock: the thread could lose the processor while it holds one.
    std::atomic<std::uint32_t> calls_{};
    std::atomic<bool> present_{false};  ///< the thread found a crowd when it was last called
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::ring
