// SPDX-License-Identifier: BSD-3-Clause
// Runs tasks in parallel, and hands out their results in the order in which they were pushed. Used
// by one thread.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

namespace versavis::client {

template <class Result>
class TaskQueue {
 public:
    explicit TaskQueue(std::size_t tasks_per_processor)
        : limit_(tasks_per_processor * std::max(1U, std::thread::hardware_concurrency())) {}

    /// No more tasks may be pushed: take() a result first.
    bool full() const { return results_.size() >= limit_; }

    /// If no thread can be started, take() does the work.
    template <class Task>
    void push(Task task) {
        // What std::async has tried to start is moved away when it falls back: it gets a copy.
        const auto shared = std::make_shared<Task>(std::move(task));
        const auto run = [shared] { return (*shared)(); };
        results_.push_back(std::async(run));
    }

    /// The oldest result; none if it is not ready, unless `wait`, or if there is none.
    std::optional<Result> take(bool wait) {
        if (results_.empty()) return std::nullopt;
        auto& first = results_.front();
        if (!wait && first.wait_for(std::chrono::seconds(0)) == std::future_status::timeout)
            return std::nullopt;
        std::optional<Result> result(first.get());
        results_.pop_front();
        return result;
    }

 private:
    std::size_t limit_;
    std::deque<std::future<Result>> results_;
};

}  // namespace versavis::client
