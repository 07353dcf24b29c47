// SPDX-License-Identifier: BSD-3-Clause
#include "client/thread_without_signals.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis::ring;

namespace {

/// Those that this thread does not take.
std::vector<int> blocked_signals() {
    sigset_t mask;
    ::pthread_sigmask(SIG_SETMASK, nullptr, &mask);
    std::vector<int> found;
    for (const int number : {SIGHUP, SIGINT, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGTERM, SIGCHLD,
                             SIGIO, SIGWINCH, SIGRTMIN, SIGRTMAX})
        if (sigismember(&mask, number) == 1) found.push_back(number);
    return found;
}

}  // namespace

TEST_CASE("thread_without_signals: takes no signal, and its maker takes those that it did") {
    const std::vector<int> before = blocked_signals();
    std::vector<int> inside;
    start_thread_without_signals([&] { inside = blocked_signals(); }).join();
    CHECK(inside.size() == 12);
    CHECK(blocked_signals() == before);
}
