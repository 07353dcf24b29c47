// SPDX-License-Identifier: BSD-3-Clause
#include "log.hpp"

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

}  // namespace

void set_log_level(LogLevel level) { threshold = level; }

void log_line(LogLevel level, const std::string& subject, const std::string& text) {
    if (level > threshold.load()) return;
    static const bool journal = std::getenv("JOURNAL_STREAM") != nullptr;
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
