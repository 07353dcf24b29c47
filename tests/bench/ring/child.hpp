// SPDX-License-Identifier: BSD-3-Clause
// Processes of a measurement, and what they note in memory that they share.
#pragma once

#include <sys/types.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::bench {

/// A copy of this process that does `body` and ends. Its end is waited for; the destructor kills.
class Child {
 public:
    explicit Child(const std::function<void()>& body);
    Child(Child&& other) noexcept;
    Child& operator=(Child&&) = delete;
    ~Child();

    /// Throws when it ended otherwise than well, or not within `timeout`.
    void finish(Duration timeout);

 private:
    pid_t pid_;
};

/// What this process has used so far.
struct Usage {
    double cpu_ns = 0;
    double page_faults = 0;  ///< without reading from a disk

    static Usage now();
    Usage operator-(const Usage& before) const {
        return {cpu_ns - before.cpu_ns, page_faults - before.page_faults};
    }
};

/// What one process found.
struct Sheet {
    static constexpr std::size_t capacity = 30000;

    Usage usage;
    std::uint64_t items = 0;
    std::uint64_t begin_ns = 0;
    std::uint64_t end_ns = 0;
    std::uint64_t sum = 0;  ///< of what was read, so that it is read
    std::size_t value_count = 0;
    double values[capacity]{};

    void add(double value) {
        if (value_count < capacity) values[value_count++] = value;
    }

    /// So that notes cause no page faults; each process has to.
    void touch() { std::fill_n(values, capacity, 0.0); }
};

/// Shared by this process and all of its children from here on.
std::shared_ptr<void> shared_memory(std::size_t size);

/// A `T`, zeroed, shared by this process and its children.
template <class T>
std::shared_ptr<T> make_shared_between_processes() {
    auto memory = shared_memory(sizeof(T));
    return {memory, new (memory.get()) T};
}

}  // namespace versavis::bench
