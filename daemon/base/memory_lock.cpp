// SPDX-License-Identifier: BSD-3-Clause
#include "memory_lock.hpp"

#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <system_error>

namespace versavis::daemon {

namespace {

constexpr const char* where = "[memory] lock";
constexpr const char* cure =
    "LimitMEMLOCK=infinity in the unit, 'ulimit -l unlimited' as root, or lock = false";

}  // namespace

Expected<> lock_memory() {
    if (::mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
    const int error = errno;
    rlimit limit{};
    ::getrlimit(RLIMIT_MEMLOCK, &limit);
    return failure(where,
                   fmt::format("memory cannot be locked: {} (limit: {} KiB)",
                               std::error_code(error, std::generic_category()).message(),
                               limit.rlim_cur >> 10U),
                   cure);
}

}  // namespace versavis::daemon
