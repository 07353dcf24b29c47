// SPDX-License-Identifier: BSD-3-Clause
// A disk that is soon full.
#pragma once

#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace versavis::test {

/// Mounts one of `size`, "8m" for example, at `directory`, for the calling process alone, which
/// should be a child made for that. False: the machine does not allow it.
inline bool mount_small_disk(const std::string& directory, const std::string& size) {
    const auto user = ::geteuid();
    const auto group = ::getegid();
    if (::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " << user << " 1";
    std::ofstream("/proc/self/gid_map") << "0 " << group << " 1";
    return ::mount("disk", directory.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
}

}  // namespace versavis::test
