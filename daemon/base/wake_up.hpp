// SPDX-License-Identifier: BSD-3-Clause
// Wakes one thread that waits, without a lock: a call that comes before the wait is not lost.
#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>

#include "posix/file_descriptor.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

class WakeUp {
 public:
    WakeUp() : file_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

    /// From any thread.
    void signal() const {
        const std::uint64_t one = 1;
        [[maybe_unused]] const auto written = ::write(file_.get(), &one, sizeof one);
    }

    /// Returns when there was a signal since the last wait, or after `timeout`.
    void wait(Duration timeout) const {
        const std::int64_t ns = std::max<std::int64_t>(timeout.ns, 0);
        const timespec limit{ns / 1'000'000'000, ns % 1'000'000'000};
        pollfd signalled{file_.get(), POLLIN, 0};
        if (::ppoll(&signalled, 1, &limit, nullptr) <= 0) return;
        std::uint64_t count = 0;
        [[maybe_unused]] const auto taken = ::read(file_.get(), &count, sizeof count);
    }

 private:
    FileDescriptor file_;
};

}  // namespace versavis::daemon
