// SPDX-License-Identifier: BSD-3-Clause
#include "log.hpp"

#include <sys/uio.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <vector>

#include "posix/journal.hpp"

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

/// The first half of the id tells it from those of other programs, the second is FNV-1a of the
/// word.
std::string message_id(std::string_view fault) {
    constexpr std::uint64_t own = 0x7e3ab94cd1f54d26;
    constexpr std::uint64_t fnv_offset = 0xcbf29ce484222325;
    constexpr std::uint64_t fnv_prime = 0x100000001b3;
    std::uint64_t hash = fnv_offset;
    for (const char c : fault) hash = (hash ^ static_cast<unsigned char>(c)) * fnv_prime;
    return fmt::format("{:016x}{:016x}", own, hash);
}

void log_line(LogLevel level, const std::string& subject, const std::string& text,
              const std::string& fault) {
    if (level > threshold.load()) return;
    static const bool journal = is_journal(STDERR_FILENO);
    if (journal) {
        std::vector<std::string> fields{fmt::format("MESSAGE={}: {}", subject, text),
                                        fmt::format("PRIORITY={}", static_cast<int>(level)),
                                        "VERSAVIS_SUBJECT=" + subject};
        if (!fault.empty()) {
            fields.push_back("VERSAVIS_FAULT=" + fault);
            fields.push_back("MESSAGE_ID=" + message_id(fault));
        }
        std::vector<iovec> parts;
        for (std::string& field : fields) parts.push_back({field.data(), field.size()});
        sd_journal_sendv(parts.data(), static_cast<int>(parts.size()));
        return;
    }
    const std::string line = fmt::format("versavisd: {}: {}: {}\n", name(level), subject, text);
    [[maybe_unused]] const auto written =
        ::write(STDERR_FILENO, line.data(), line.size());  // one call: lines stay whole
}

}  // namespace versavis::daemon
