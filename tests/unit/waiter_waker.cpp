// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/waiter_waker.hpp"

#include <atomic>
#include <catch2/catch.hpp>
#include <thread>

#include "../support/shortage.hpp"
#include "../support/sleepers.hpp"
#include "../support/threads.hpp"

using namespace versavis;
using namespace versavis::ring;
using test::Sleepers;

TEST_CASE("waiter_waker: all are woken, few or many, time and again [threads]", "[threads]") {
    std::atomic<std::uint32_t> word{0};
    WaiterWaker crowd;
    for (const int count : {0, 1, 4, 5, 40, 40, 0, 5, 1, 40}) {
        const Sleepers sleepers(word, count);
        crowd.wake(word);
        sleepers.wait_until_all_are_woken();
    }
}

TEST_CASE("waiter_waker: a few need no thread, and one for many rests [threads]", "[threads]") {
    std::atomic<std::uint32_t> word{0};
    const auto before = test::threads();
    WaiterWaker crowd;
    for (const int count : {0, 1, 2}) {
        const Sleepers sleepers(word, count);
        crowd.wake(word);
        sleepers.wait_until_all_are_woken();
    }
    while (test::threads() != before) std::this_thread::yield();
    {
        const Sleepers sleepers(word, 40);
        crowd.wake(word);
        sleepers.wait_until_all_are_woken();
    }
    test::Rest(test::wait_for_one_more(before)).wait();
}

TEST_CASE("waiter_waker: where no thread is to be had, all are woken as well [threads]",
          "[threads]") {
    std::atomic<std::uint32_t> word{0};
    const Sleepers sleepers(word, 40);
    WaiterWaker crowd;
    const test::NoThreads none;
    crowd.wake(word);
    sleepers.wait_until_all_are_woken();
}

TEST_CASE("waiter_waker: it ends while its thread is at work [threads]", "[threads]") {
    std::atomic<std::uint32_t> word{0};
    for (int i = 0; i < 50; ++i) {
        const Sleepers sleepers(word, 8);
        WaiterWaker crowd;
        for (int call = 0; call < 3; ++call) crowd.wake(word);
    }
    SUCCEED();
}
