// SPDX-License-Identifier: BSD-3-Clause
#include "record/write_back.hpp"

#include <fcntl.h>
#include <unistd.h>

#include "posix/thread.hpp"

namespace versavis::client {

WriteBack::WriteBack() : thread_(start_thread("write back", [this] { run(); })) {}

WriteBack::~WriteBack() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void WriteBack::push(int descriptor, std::uint64_t end) {
    {
        const std::lock_guard lock(mutex_);
        descriptor_ = descriptor;
        end_ = end;
    }
    changed_.notify_all();
}

void WriteBack::finish() {
    std::unique_lock lock(mutex_);
    descriptor_ = -1;
    changed_.wait(lock, [this] { return !busy_; });
}

void WriteBack::run() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stop_ || descriptor_ >= 0; });
        if (stop_) return;
        const int descriptor = descriptor_;
        const auto end = static_cast<off_t>(end_);
        descriptor_ = -1;
        busy_ = true;
        lock.unlock();
        // Whoever writes next or closes the file meets the error, and reports it.
        ::fdatasync(descriptor);
        ::posix_fadvise(descriptor, 0, end, POSIX_FADV_DONTNEED);
        lock.lock();
        busy_ = false;
        changed_.notify_all();
    }
}

}  // namespace versavis::client
