// SPDX-License-Identifier: BSD-3-Clause
// How threads are started: with a name, which `top -H` and `perf` show, and without signals, which
// are for the threads that the program chooses.
#pragma once

#include <pthread.h>

#include <csignal>
#include <string>
#include <thread>
#include <utility>

namespace versavis {

/// The kernel keeps the first 15 bytes of `name`. Throws std::system_error where no thread is to be
/// had, as std::thread does.
template <class Work>
std::thread start_thread(const std::string& name, Work work) {
    struct BlockedSignals {
        BlockedSignals() {
            sigset_t all;
            ::sigfillset(&all);
            ::pthread_sigmask(SIG_SETMASK, &all, &before);
        }
        ~BlockedSignals() { ::pthread_sigmask(SIG_SETMASK, &before, nullptr); }
        BlockedSignals(const BlockedSignals&) = delete;
        BlockedSignals& operator=(const BlockedSignals&) = delete;
        sigset_t before{};
    };
    const BlockedSignals blocked;  // the new thread inherits it
    return std::thread([name = name.substr(0, 15), work = std::move(work)]() mutable {
        ::pthread_setname_np(::pthread_self(), name.c_str());
        work();
    });
}

}  // namespace versavis
