// SPDX-License-Identifier: BSD-3-Clause
#include "library_log.hpp"

#include <arv.h>

#include <cstdlib>
#include <cstring>
#include <mutex>

#include "log.hpp"

namespace versavis::daemon {

namespace {

struct Limit {
    std::mutex mutex;
    LineLimit lines;
};

/// GLib has one writer for the whole process, and it never ends.
Limit& limit() {
    static auto* const only = new Limit;
    return *only;
}

GLogWriterOutput write(GLogLevelFlags level, const GLogField* fields, gsize count, gpointer) {
    if ((level & (G_LOG_LEVEL_INFO | G_LOG_LEVEL_DEBUG)) != 0) return G_LOG_WRITER_HANDLED;
    const HostTime now = host_now();
    {
        const std::lock_guard lock(limit().mutex);
        if (!limit().lines.take(now)) return G_LOG_WRITER_HANDLED;
    }
    std::string domain = "glib";
    std::string text;
    for (gsize i = 0; i < count; ++i) {
        const auto* value = static_cast<const char*>(fields[i].value);
        const std::string words =
            fields[i].length < 0 ? std::string(value)
                                 : std::string(value, static_cast<std::size_t>(fields[i].length));
        if (std::strcmp(fields[i].key, "MESSAGE") == 0) text = words;
        if (std::strcmp(fields[i].key, "GLIB_DOMAIN") == 0) domain = words;
    }
    for (char& letter : text)
        if (static_cast<unsigned char>(letter) < ' ')
            letter = ' ';  // what a device sent may be in it
    log(LogLevel::warning, "library", "{}: {}", domain, text);
    return G_LOG_WRITER_HANDLED;
}

}  // namespace

void route_library_log() {
    g_log_set_writer_func(write, nullptr, nullptr);
    // Aravis' own messages go straight to standard error. What matters of them, the service sees.
    if (std::getenv("ARV_DEBUG") == nullptr) arv_debug_enable("all:0");
}

void report_suppressed_library_lines(HostTime now) {
    std::uint64_t count = 0;
    {
        const std::lock_guard lock(limit().mutex);
        count = limit().lines.collect(now);
    }
    if (count > 0) log(LogLevel::warning, "library", "{} more lines like these", count);
}

}  // namespace versavis::daemon
