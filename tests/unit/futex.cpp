// SPDX-License-Identifier: BSD-3-Clause
#include "client/futex.hpp"

#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <catch2/catch.hpp>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/sleep.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

/// Words with values of their own.
struct FutexWords {
    std::array<std::atomic<std::uint32_t>, 200> words{};

    FutexWords() {
        for (std::uint32_t i = 0; i < words.size(); ++i) words[i] = i + 1;
    }
    std::vector<FutexWord> first(std::size_t count) const {
        std::vector<FutexWord> made;
        for (std::size_t i = 0; i < count; ++i) made.push_back({&words[i], words[i]});
        return made;
    }
};

/// By the clock of futexes.
template <class Wait>
std::chrono::nanoseconds span_of(const Wait& wait) {
    const auto begun = std::chrono::steady_clock::now();
    wait();
    return std::chrono::steady_clock::now() - begun;
}

long sleeps_of_this_thread() {
    rusage usage{};
    ::getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_nvcsw;
}

/// From here on this process cannot wait for several words.
bool forbid_waiting_for_any(unsigned error) {
    std::array<sock_filter, 4> filter{
        {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
         BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, test::futex_waitv_number, 0, 1),
         BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | error),
         BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)}};
    const sock_fprog program{filter.size(), filter.data()};
    return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

}  // namespace

TEST_CASE_METHOD(FutexWords, "futex: a wait without news lasts as long as was asked") {
    if (!test::kernel_waits_for_any()) return;
    using std::chrono::milliseconds;
    for (const std::size_t count : {0, 1, 2, 128, 200})
        for (const milliseconds span : {milliseconds(1), milliseconds(30)})
            CHECK(span_of([&] {
                      futex_wait_any(first(count), std::chrono::nanoseconds(span).count());
                  }) >= span);
    CHECK(span_of([&] { futex_wait_any(first(2), 1'100'000'000); }) >= milliseconds(1100));
}

TEST_CASE_METHOD(FutexWords, "futex: each of several words wakes who waits for all [threads]",
                 "[threads]") {
    if (!test::kernel_waits_for_any()) return;
    for (const std::size_t count : {1, 3, 128})
        for (const std::size_t one : {std::size_t{0}, count / 2, count - 1}) {
            std::thread waiting([&] { futex_wait_any(first(count), seconds(60).ns); });
            CHECK(test::wake_sleeper(words[one]));
            waiting.join();
        }
}

TEST_CASE_METHOD(FutexWords, "futex: a word that has changed before costs no sleep", "[kernel]") {
    auto changed = first(2);
    ++words[1];
    const long before = sleeps_of_this_thread();
    for (int i = 0; i < 100; ++i) futex_wait_any(changed, seconds(60).ns);
    CHECK(sleeps_of_this_thread() - before < 50);
}

TEST_CASE_METHOD(FutexWords,
                 "futex: who cannot wait for several words waits for the first, not long") {
    for (const unsigned error : {ENOSYS, EPERM}) {
        if (!test::in_process([&] { return forbid_waiting_for_any(error); })) {
            WARN("not tested: no system call can be forbidden here");
            return;
        }
        CHECK(test::in_process([&] {
            if (!forbid_waiting_for_any(error)) return false;
            const auto wait = [&] {
                for (int i = 0; i < 20; ++i) futex_wait_any(first(2), seconds(60).ns);
            };
            return span_of(wait) >= std::chrono::milliseconds(20);
        }));
    }
}
