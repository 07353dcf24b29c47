// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/crowd.hpp"

#include <atomic>
#include <catch2/catch.hpp>
#include <thread>
#include <vector>

#include "client/futex.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

constexpr std::int64_t long_ns = 60'000'000'000;

/// Threads that sleep on one word, each until the word has moved on.
struct Sleepers {
    explicit Sleepers(int count) {
        for (int i = 0; i < count; ++i)
            threads.emplace_back([this] {
                ++awake;
                futex_wait(word, 0, long_ns);
                ++woken;
            });
        while (awake < count) std::this_thread::yield();
    }
    ~Sleepers() {
        for (std::thread& thread : threads) thread.join();
    }

    std::atomic<std::uint32_t> word{0};
    std::atomic<int> awake{0};
    std::atomic<int> woken{0};
    std::vector<std::thread> threads;
};

}  // namespace

TEST_CASE("crowd: all are woken, few or many [threads]", "[threads]") {
    for (const int count : {0, 1, 4, 5, 40}) {
        Sleepers sleepers(count);
        Crowd crowd;
        sleepers.word = 1;  // who is not asleep yet does not fall asleep
        crowd.wake(sleepers.word);
        while (sleepers.woken < count) std::this_thread::yield();
        CHECK(sleepers.woken == count);
    }
}

TEST_CASE("crowd: it ends while its thread is at work [threads]", "[threads]") {
    for (int i = 0; i < 50; ++i) {
        Sleepers sleepers(8);
        sleepers.word = 1;
        {
            Crowd crowd;
            for (int call = 0; call < 3; ++call) crowd.wake(sleepers.word);
        }
        futex_wake(sleepers.word, 8);
    }
    SUCCEED();
}
