// SPDX-License-Identifier: BSD-3-Clause
// Brings what was written to the disk, steadily, and out of the page cache, beside the writing.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

namespace versavis::client {

/// A recording would else fill all memory with pages that nobody reads, and stop when the kernel
/// writes them out all at once.
class WriteBack {
 public:
    WriteBack();
    ~WriteBack();  ///< waits for what is under way
    WriteBack(const WriteBack&) = delete;
    WriteBack& operator=(const WriteBack&) = delete;

    /// All of the file up to `end` may go. The descriptor stays open until the next call of
    /// finish(). Returns at once.
    void push(int descriptor, std::uint64_t end);

    /// Waits until nothing is under way.
    void finish();

 private:
    void run();

    std::mutex mutex_;
    std::condition_variable changed_;
    int descriptor_ = -1;
    std::uint64_t end_ = 0;
    bool busy_ = false;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace versavis::client
