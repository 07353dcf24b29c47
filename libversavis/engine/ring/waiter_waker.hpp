// SPDX-License-Identifier: BSD-3-Clause
// Wakes the readers of a ring: a few directly, many by a separate thread, so that no number of
// readers delays the writer.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

namespace versavis::ring {

/// The thread runs from the first time that many readers wait. Called by the thread that publishes,
/// one at a time.
class WaiterWaker {
 public:
    WaiterWaker() = default;
    WaiterWaker(const WaiterWaker&) = delete;
    WaiterWaker& operator=(const WaiterWaker&) = delete;
    ~WaiterWaker();  ///< waits for the thread, which uses the word

    /// Wakes all who sleep on `word`, which is the same in all calls.
    void wake(const std::atomic<std::uint32_t>& word);

 private:
    void notify();
    void call(const std::atomic<std::uint32_t>& word);
    void run(const std::atomic<std::uint32_t>& word);

    // No lock: the thread could lose the processor while it holds one.
    std::atomic<std::uint32_t> calls_{};
    std::atomic<bool> present_{false};  ///< the thread found many sleepers when it was last called
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::ring
