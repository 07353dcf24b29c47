// SPDX-License-Identifier: BSD-3-Clause
// The ring of events: what happened to triggers, frames, cameras and the board.
#pragma once

#include <mutex>
#include <string>

#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/metadata.hpp"

namespace versavis::daemon {

struct JournalEntry {
    EventKind kind{};
    EventReason reason = EventReason::none;
    std::uint32_t source = 0;
    std::string source_name;
    std::int64_t value = 0;
    std::optional<BoardTime> board_time{};  ///< none: it happened on the host, now
    std::int64_t expected = 0;              ///< of a message that was doubted
    bool suspect = false;                   ///< its board time is doubted
    std::uint32_t count = 0;                ///< of triggers_skipped: how many
};

/// Thread-safe.
class EventJournal {
 public:
    EventJournal(ring::Writer ring, clock::Translator& translator)
        : ring_(std::move(ring)), translator_(translator) {}

    void add(const JournalEntry& entry);
    void heartbeat(HostTime now);
    std::uint64_t items();

 private:
    std::mutex mutex_;
    ring::Writer ring_;
    clock::Translator& translator_;
};

}  // namespace versavis::daemon
