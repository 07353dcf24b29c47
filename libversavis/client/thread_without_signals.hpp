// SPDX-License-Identifier: BSD-3-Clause
// Starts a thread with all signals blocked: signals are for the program's own threads.
#pragma once

#include <pthread.h>

#include <csignal>
#include <thread>
#include <utility>

namespace versavis::ring {

/// Throws std::system_error if no thread can be started, as std::thread does.
template <class Work>
std::thread start_thread_without_signals(Work work) {
    struct Quiet {
        Quiet() {
            sigset_t all;
            ::sigfillset(&all);
            ::pthread_sigmask(SIG_SETMASK, &all, &before);
        }
        ~Quiet() { ::pthread_sigmask(SIG_SETMASK, &before, nullptr); }
        Quiet(const Quiet&) = delete;
        Quiet& operator=(const Quiet&) = delete;
        sigset_t before{};
    };
    const Quiet quiet;  // the new thread inherits it
    return std::thread(std::move(work));
}

}  // namespace versavis::ring
