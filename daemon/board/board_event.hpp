// SPDX-License-Identifier: BSD-3-Clause
// Events of the board in the words of the event ring.
#pragma once

#include <optional>

#include "stream/event_journal.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// Whose number `source` of such an event is.
enum class EventSource { board, camera, imu };
EventSource source_of(wire::EventKind kind);

/// Source and name are the board's own. None: a newer board tells what this version does not know.
std::optional<JournalEntry> journal_entry(const wire::Event& event);

}  // namespace versavis::daemon
