// SPDX-License-Identifier: BSD-3-Clause
// Work that may wait long for a device: in threads of its own, which nobody has to wait for.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>

#include "posix/thread.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// How long a thread waits for a camera or stream to be released.
constexpr Duration release_timeout = milliseconds(250);

/// Thread-safe. May end before its work does.
class DetachedTasks {
 public:
    /// True: it was done within `patience`. The work must own all that it uses.
    bool run(std::function<void()> work, Duration patience) {
        ++*unfinished_;
        std::promise<void> done;
        auto future = done.get_future();
        start_thread("release", [work = std::move(work), done = std::move(done),
                                 unfinished = unfinished_]() mutable {
            work();
            work = nullptr;
            --*unfinished;
            done.set_value();
        }).detach();
        return future.wait_for(std::chrono::nanoseconds(patience.ns)) == std::future_status::ready;
    }

    unsigned unfinished() const { return *unfinished_; }

 private:
    std::shared_ptr<std::atomic<unsigned>> unfinished_ = std::make_shared<std::atomic<unsigned>>(0);
};

}  // namespace versavis::daemon
