// SPDX-License-Identifier: BSD-3-Clause
#include "posix/thread.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace versavis;

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

TEST_CASE("thread: has its name and takes no signal, and its maker takes those that it did",
          "[kernel]") {
    const std::vector<int> before = blocked_signals();
    std::vector<int> inside;
    char name[16]{};
    start_thread("a name of 20 bytes..", [&] {
        inside = blocked_signals();
        ::pthread_getname_np(::pthread_self(), name, sizeof name);
    }).join();
    CHECK(name == std::string("a name of 20 by"));
    CHECK(inside.size() == 12);
    CHECK(blocked_signals() == before);
}
