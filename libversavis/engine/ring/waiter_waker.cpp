// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/waiter_waker.hpp"

#include <climits>
#include <system_error>

#include "client/futex.hpp"
#include "posix/thread.hpp"

namespace versavis::ring {

namespace {

// Readers that the writer wakes by itself; where there are more, the thread wakes all. If lower, a
// stereo consumer, a recorder and a viewer wait for the thread, some 10 us; if higher, publication
// to that many takes longer.
constexpr int woken_at_once = 4;

}  // namespace

WaiterWaker::~WaiterWaker() {
    stop_ = true;
    notify();
    if (thread_.joinable()) thread_.join();
}

void WaiterWaker::wake(const std::atomic<std::uint32_t>& word) {
    // Many sleepers last time are most likely there again: waking some of them here would only make
    // the thread wait for a processor behind them.
    if (present_.load(std::memory_order_relaxed) ||
        futex_wake(word, woken_at_once) == woken_at_once)
        call(word);
}

void WaiterWaker::notify() {
    calls_.fetch_add(1, std::memory_order_release);
    calls_.notify_one();
}

void WaiterWaker::call(const std::atomic<std::uint32_t>& word) {
    notify();
    if (thread_.joinable()) return;
    try {
        thread_ = start_thread("waker", [this, &word] { run(word); });
    } catch (const std::system_error&) {
        futex_wake(word, INT_MAX);  // no thread available: slower, but all are woken
    }
}

void WaiterWaker::run(const std::atomic<std::uint32_t>& word) {
    for (std::uint32_t seen = 0; !stop_;) {
        calls_.wait(seen, std::memory_order_acquire);
        seen = calls_.load(std::memory_order_acquire);
        present_.store(futex_wake(word, INT_MAX) > woken_at_once, std::memory_order_relaxed);
    }
}

}  // namespace versavis::ring
