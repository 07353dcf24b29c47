// SPDX-License-Identifier: BSD-3-Clause
// Finds threads that are stuck: those of devices, which never sleep for long, are watched by the
// time that they have used of a processor.
#pragma once

#include <pthread.h>

#include <ctime>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "versavis/time.hpp"

namespace versavis::daemon {

/// Thread-safe.
class ThreadWatch {
 private:
    struct Thread {
        std::string name;
        Duration limit;
        clockid_t clock;
        Duration used;
        HostTime since;  ///< it has not run
    };
    using Threads = std::list<Thread>;

 public:
    /// As long as this is there, its thread is watched.
    class Watched {
     public:
        Watched(ThreadWatch& watch, Threads::iterator thread) : watch_(watch), thread_(thread) {}
        ~Watched() {
            const std::lock_guard lock(watch_.mutex_);
            watch_.threads_.erase(thread_);
        }
        Watched(const Watched&) = delete;
        Watched& operator=(const Watched&) = delete;

     private:
        ThreadWatch& watch_;
        Threads::iterator thread_;
    };

    /// The thread that calls it, which is stuck if it does not run at all for so long.
    [[nodiscard]] Watched watch(std::string name, Duration limit) {
        clockid_t clock{};
        ::pthread_getcpuclockid(::pthread_self(), &clock);
        const std::lock_guard lock(mutex_);
        return {*this, threads_.insert(threads_.end(), {std::move(name), limit, clock, {}, {}})};
    }

    /// The name of one that is stuck; none: there is none. To be called several times a second.
    std::optional<std::string> stuck(HostTime now) {
        const std::lock_guard lock(mutex_);
        const bool paused = now - looked_ > longest_pause;  // so were the others, perhaps
        looked_ = now;
        std::optional<std::string> found;
        for (Thread& thread : threads_) {
            timespec time{};
            ::clock_gettime(thread.clock, &time);
            const Duration used{std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec};
            if (paused || std::exchange(thread.used, used) != used) thread.since = now;
            if (now - thread.since > thread.limit) found = thread.name;
        }
        return found;
    }

 private:
    static constexpr Duration longest_pause = seconds(1);

    std::mutex mutex_;
    Threads threads_;
    HostTime looked_;
};

/// That of this process.
inline ThreadWatch& thread_watch() {
    static ThreadWatch watch;
    return watch;
}

}  // namespace versavis::daemon
