// SPDX-License-Identifier: BSD-3-Clause
// Threads have names, so that `top -H` and `perf` show which of them costs what.
#pragma once

#include <pthread.h>

#include <string>

namespace versavis::daemon {

/// Names this thread; the kernel keeps the first 15 bytes.
inline void name_thread(const std::string& name) {
    ::pthread_setname_np(::pthread_self(), name.substr(0, 15).c_str());
}

}  // namespace versavis::daemon
