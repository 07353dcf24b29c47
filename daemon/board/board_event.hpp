// SPDX-License-Identifier: BSD-3-Clause
// Events of the board in the words of the event ring.
#pragma once

#include <optional>
#include <string>

#include "base/log.hpp"
#include "publish/event_journal.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// Whose number `source` of such an event is.
enum class EventSource { board, camera, imu };
EventSource source_of(wire::BoardEventKind kind);

/// Triggers that were not sent, by this event.
std::uint64_t skipped_triggers(const wire::Event& event);

/// What to do about a configuration that the board was to keep, and does not.
inline constexpr const char* unkept_configuration =
    "it could not store its configuration and will start with an older one at its next power-up: "
    "restart the service to try again, or set keep_configuration = false";

/// What the log has of an event about the board itself.
struct BoardRemark {
    LogLevel level = LogLevel::info;
    std::string text;
};
std::optional<BoardRemark> remark(const wire::Event& event);

/// Source and name are the board's own. None: a newer board reports what this version does not
/// know.
std::optional<JournalEntry> journal_entry(const wire::Event& event);

}  // namespace versavis::daemon
