// SPDX-License-Identifier: BSD-3-Clause
// A thread that takes none of the program's signals: they are for threads that the program knows.
#pragma once

#include <pthread.h>

#include <csignal>
#include <thread>
#include <utility>

namespace versavis::ring {

/// Throws std::system_error where no thread is to be had, as std::thread does.
template <class Work>
std::thread quiet_thread(Work work) {
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
