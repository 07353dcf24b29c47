// SPDX-License-Identifier: BSD-3-Clause
#include "log.hpp"

#include <sys/stat.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>

namespace versavis::daemon {

namespace {

std::atomic<LogLevel> threshold{LogLevel::info};

const char* name(LogLevel level) {
    switch (level) {
        case LogLevel::error: return "error";
        case LogLevel::warning: return "warning";
        case LogLevel::info: return "info";
        case LogLevel::debug: return "debug";
    }
    return "";
}

/// The variable is inherited by programs whose output leads elsewhere: only the stream that it
/// names counts.
bool standard_error_is_journal() {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat file {};
    if (stream == nullptr || ::fstat(STDERR_FILENO, &file) != 0) return false;
    return fmt::format("{}:{}", file.st_dev, file.st_ino) == stream;
}

}  // namespace

void set_log_level(LogLevel level) { threshold = level; }

void log_line(LogLevel level, const std::string& subject, const std::string& text) {
    if (level > threshold.load()) return;
    static const bool journal = standard_error_is_journal();
    if (journal) {
        sd_journal_send("MESSAGE=%s: %s", subject.c_str(), text.c_str(), "PRIORITY=%i",
                        static_cast<int>(level), "VERSAVIS_SUBJECT=%s", subject.c_str(), nullptr);
        return;
    }
    const std::string line = fmt::format("versavisd: {}: {}: {}\n", name(level), subject, text);
    [[maybe_unused]] const auto written =
        ::write(STDERR_FILENO, line.data(), line.size());  // one call: lines stay whole
}

}  // namespace versavis::daemon
