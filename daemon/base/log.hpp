// SPDX-License-Identifier: BSD-3-Clause
// Logging to the journal with structured fields, or to standard error when not under systemd.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

namespace versavis::daemon {

/// Who reads it: error and warning, the user at once; info, the user who looks; debug, a developer.
enum class LogLevel { error = 3, warning = 4, info = 6, debug = 7 };

/// Messages below `level` are dropped from now on.
void set_log_level(LogLevel level);

/// One line about `subject` (a camera's name, "board", "service"), also as journal field
/// VERSAVIS_SUBJECT. Of a fault also its word, in VERSAVIS_FAULT, and the id under which the
/// journal's catalog explains it. Thread-safe.
void log_line(LogLevel level, const std::string& subject, const std::string& text,
              const std::string& fault = {});

/// Of the journal's catalog (systemd/versavis.catalog): the same for the same word, in every
/// release.
std::string message_id(std::string_view fault);

template <class... Arguments>
void log(LogLevel level, const std::string& subject, fmt::format_string<Arguments...> format,
         Arguments&&... arguments) {
    log_line(level, subject, fmt::format(format, std::forward<Arguments>(arguments)...));
}

}  // namespace versavis::daemon
