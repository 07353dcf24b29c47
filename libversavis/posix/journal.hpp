// SPDX-License-Identifier: BSD-3-Clause
// Whether output goes to systemd's journal, which takes priorities.
#pragma once

#include <sys/stat.h>

#include <cstdlib>
#include <string>

namespace versavis {

/// $JOURNAL_STREAM is inherited by programs whose output leads elsewhere: only the stream that it
/// names counts (systemd.exec(5)).
inline bool is_journal(int descriptor) {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat file {};
    if (stream == nullptr || ::fstat(descriptor, &file) != 0) return false;
    return std::to_string(file.st_dev) + ":" + std::to_string(file.st_ino) == stream;
}

}  // namespace versavis
